//! Shared code of all palpate programs.

pub mod confirmation;
pub mod describe;
pub mod evidence;
pub mod failure;
pub mod finding;
pub mod in_order;
pub mod jsonl;
pub mod modulus;
pub mod notice;
pub mod output;
pub mod page;
pub mod plot;
pub mod progress;
pub mod quantity;
pub mod report;
pub mod text;
pub mod touch_map;
pub mod train_line;
