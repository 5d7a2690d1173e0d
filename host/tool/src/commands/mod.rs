//! Verbs for boards, recordings, converters and frames, one module each.

pub(crate) mod bring_up;
pub(crate) mod calibrate;
pub(crate) mod calibrate_touch;
pub(crate) mod campaign;
pub(crate) mod check;
pub(crate) mod chip;
pub(crate) mod coil;
pub(crate) mod decode;
pub(crate) mod devices;
pub(crate) mod doctor;
pub(crate) mod encode;
pub(crate) mod export;
pub(crate) mod faults;
pub(crate) mod flash;
pub(crate) mod info;
pub(crate) mod live;
pub(crate) mod log_table;
pub(crate) mod measure;
pub(crate) mod packaging;
pub(crate) mod record;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod rig_gauge;
pub(crate) mod serve;
pub(crate) mod settings;
pub(crate) mod watch;
