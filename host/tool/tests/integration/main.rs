//! Integration tests of `palpate`, in one program with a module for each part.

mod arguments;
mod bring_up;
mod calibration;
mod chip;
mod coil;
mod designer;
mod desk;
mod devices;
mod doctor;
#[cfg(target_os = "linux")]
mod documented;
mod field;
mod flash;
#[cfg(target_os = "linux")]
mod hostile_connections;
#[cfg(target_os = "linux")]
mod hostile_files;
mod image;
mod installed;
#[cfg(target_os = "linux")]
mod live;
mod logs;
mod long_recordings;
#[cfg(target_os = "linux")]
mod mutation;
mod outputs;
mod plan;
mod plan_ldc;
mod plan_touch;
mod read_recordings;
mod recordings;
mod records;
mod replays;
mod serve;
mod settings;
mod simulate;
mod support;
mod touch;
mod words;
mod written_files;
