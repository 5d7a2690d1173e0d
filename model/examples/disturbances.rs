//! Compares the plain eq. (2) with the estimator, under each disturbance by itself: `cargo run
//! --release -p palpate-model --example disturbances`.

#[path = "../tests/integration/common/mod.rs"]
mod common;

fn main() {
    print!("{}", common::disturbances::table());
}
