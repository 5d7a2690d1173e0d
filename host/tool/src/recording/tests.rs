use std::cell::RefCell;
use std::io::{self, ErrorKind, Write};
use std::rc::Rc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use palpate_wire::RecordDecoder;
use proptest::prelude::*;

use super::writer::Writer;
use super::*;

/// All kinds of records, including their smallest and largest values.
fn fixture() -> Vec<Entry> {
    let bytes = include_bytes!("../../../../firmware/wire/fixture/v2-records.bin");
    let mut decoder = RecordDecoder::new();
    let frames = decoder.frames(bytes).map(Result::unwrap);
    let recorded = (0..).zip(frames).map(|(number, frame)| {
        Entry::Frame(Recorded {
            host_ns: 1_700_000_000_000_000_000 + number,
            device_ns: 1_699_999_999_000_000_000 + number,
            frame,
        })
    });
    let note = Entry::Note(Note::new(ABOUT).with("tool", "a test"));
    [note].into_iter().chain(recorded).collect()
}

/// Bytes of a file with these entries, flushed after every few entries.
fn recording(entries: &[Entry]) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new()).unwrap();
    for few in entries.chunks(7) {
        few.iter().for_each(|entry| writer.add(entry).unwrap());
        writer.flush().unwrap();
    }
    writer.finish().unwrap()
}

/// Reads the entries and the damage of a file.
fn read(file: &[u8]) -> (Vec<Entry>, Option<String>) {
    let mut reader = Reader::new(file);
    let entries = reader.by_ref().collect();
    assert_eq!(reader.unreadable(), 0);
    (entries, reader.damage())
}

#[test]
fn what_is_recorded_is_read_back_bit_for_bit() {
    let entries = fixture();
    assert!(entries.len() > 40);
    assert_eq!(read(&recording(&entries)), (entries, None));
}

#[test]
fn a_line_of_the_log_is_there_for_other_programs_and_reading_passes_over_it() {
    let line = LogLine {
        time: "1.5".to_owned(),
        level: "warn",
        message: "converter up".to_owned(),
    };
    let host_ns = 1_700_000_000_000_000_005;
    let log = Entry::Log(Logged { host_ns, line });
    let file = recording(&[&[log], &fixture()[..]].concat());
    assert_eq!(read(&file), (fixture(), None));
    let mut messages = mcap::MessageStream::new(&file).unwrap();
    let message = messages.next().unwrap().unwrap();
    assert_eq!(message.channel.topic, "/log");
    assert_eq!(
        message.channel.schema.as_ref().unwrap().name,
        "foxglove.Log"
    );
    assert_eq!(message.log_time, host_ns);
    let text: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
    assert_eq!(text["message"], "converter up");
    assert_eq!(text["level"], 3);
    assert_eq!(text["timestamp"]["nsec"], 5);
}

#[test]
fn the_queue_of_a_recording_stays_below_5_mb() {
    assert!(size_of::<Entry>() * recorder::QUEUE < 5_000_000);
}

/// A sample with these values.
fn sample(frequency_hz: f64, force_n: f32) -> Entry {
    let mut entries = fixture().into_iter();
    let sample = entries.find_map(|entry| match entry {
        Entry::Frame(Recorded { frame, .. }) => match frame.message {
            Record::Sample(sample) if !sample.channels.is_empty() => Some((frame.header, sample)),
            _ => None,
        },
        Entry::Note(_) | Entry::Log(_) => None,
    });
    let (header, mut sample) = sample.unwrap();
    sample.force_n = Some(force_n);
    sample.channels[0].frequency_hz = frequency_hz;
    Entry::Frame(Recorded {
        host_ns: 2,
        device_ns: 1,
        frame: Frame {
            header,
            message: Record::Sample(sample),
        },
    })
}

proptest! {
    #[test]
    fn every_finite_number_is_read_back(
        frequency_hz in proptest::num::f64::ANY.prop_filter("finite", |x| x.is_finite()),
        force_n in proptest::num::f32::ANY.prop_filter("finite", |x| x.is_finite()),
    ) {
        let entries = [sample(frequency_hz, force_n)];
        prop_assert_eq!(&read(&recording(&entries)).0, &entries);
    }

    #[test]
    fn a_recording_that_is_cut_anywhere_gives_its_beginning(part in 0.0..1.0_f64) {
        let entries = fixture();
        let file = recording(&entries);
        let length = (part * file.len() as f64) as usize;
        let (found, damage) = read(&file[..length]);
        prop_assert!(entries.starts_with(&found));
        prop_assert!(damage.is_some());
    }

    #[test]
    fn a_recording_with_a_wrong_byte_gives_nothing_wrong(
        part in 0.0..1.0_f64,
        change in 1_u8..,
    ) {
        let entries = fixture();
        let mut file = recording(&entries);
        let place = (part * file.len() as f64) as usize;
        file[place] ^= change;
        let mut reader = Reader::new(&file[..]);
        let frames = |entries: &[Entry]| -> Vec<Entry> {
            let frames = entries.iter().filter(|entry| matches!(entry, Entry::Frame(_)));
            frames.cloned().collect()
        };
        let found: Vec<Entry> = reader.by_ref().collect();
        let known = frames(&entries);
        prop_assert!(frames(&found).iter().all(|frame| known.contains(frame)));
    }
}

/// A disk that is full after `capacity` bytes.
#[derive(Clone)]
struct SmallDisk {
    written: Rc<RefCell<Vec<u8>>>,
    capacity: usize,
}

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut written = self.written.borrow_mut();
        let room = self.capacity - written.len();
        if room == 0 {
            return Err(ErrorKind::StorageFull.into());
        }
        let count = bytes.len().min(room);
        written.extend(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes the entries in flushes of seven. Returns the number of flushed entries when writing
/// failed.
fn write_to(disk: SmallDisk, entries: &[Entry]) -> (usize, io::Result<()>) {
    let mut flushed = 0;
    let write = || {
        let mut writer = Writer::new(disk)?;
        for few in entries.chunks(7) {
            for entry in few {
                writer.add(entry)?;
            }
            writer.flush()?;
            flushed += few.len();
        }
        writer.finish().map(|_| ())
    };
    let written = write();
    (flushed, written)
}

#[test]
fn a_full_disk_is_an_error_and_leaves_what_was_flushed() {
    let entries = fixture();
    let whole = recording(&entries).len();
    for capacity in (100..whole).step_by(997) {
        let disk = SmallDisk {
            written: Rc::default(),
            capacity,
        };
        let (flushed, written) = write_to(disk.clone(), &entries);
        assert_eq!(written.unwrap_err().kind(), ErrorKind::StorageFull);
        let (found, damage) = read(&disk.written.borrow());
        assert!(found.len() >= flushed && entries.starts_with(&found));
        assert!(damage.is_some());
    }
}

#[test]
fn a_recording_does_not_take_the_place_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("r.mcap");
    std::fs::write(&file, "old").unwrap();
    assert!(Recorder::create(&file).is_err());
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "old");
}

/// The file's contents at any time are those that a program killed then would leave.
#[test]
fn a_recording_that_is_killed_keeps_all_but_the_last_second() {
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = Recorder::create(&folder.path().join("r.mcap")).unwrap();
    let Entry::Frame(frame) = sample(3e6, 1.0) else {
        panic!("a sample is a frame");
    };
    let begin = Instant::now();
    let mut looks = [430, 910, 1_350, 2_470]
        .map(Duration::from_millis)
        .into_iter()
        .peekable();
    while let Some(&look) = looks.peek() {
        sleep(Duration::from_millis(1));
        let elapsed = begin.elapsed();
        let host_ns = u64::try_from(elapsed.as_nanos()).unwrap();
        recorder.add(Recorded {
            host_ns,
            ..frame.clone()
        });
        if elapsed > look {
            looks.next();
            let (found, _) = read(&std::fs::read(recorder.partial()).unwrap());
            let last_s = found.last().map_or(0.0, |entry| match entry {
                Entry::Frame(recorded) => recorded.host_ns as f64 * 1e-9,
                Entry::Note(_) | Entry::Log(_) => 0.0,
            });
            let lost_s = elapsed.as_secs_f64() - last_s;
            assert!(lost_s < 1.0, "{lost_s} s");
        }
    }
    assert_eq!(recorder.lost(), 0);
    recorder.finish().unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_named_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let file = folder.path().join("r.mcap");
    let recorder = Recorder::on(full, &file).unwrap();
    let said = recorder.finish().unwrap_err().to_string();
    assert!(said.contains("the disk is full"), "{said}");
    assert!(!file.exists());
}
