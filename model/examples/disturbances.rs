//! The plain eq. (2) beside the estimator, under each disturbance by itself:
//! `cargo run --release -p palpate-model --example disturbances`.

#[path = "../tests/integration/common/mod.rs"]
mod common;

fn main() {
    print!("{}", common::disturbances::table());
}
