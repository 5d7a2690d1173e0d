//! The drive of an RP2040 in its boot loader (RP2040 datasheet 2.8.4).

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// File that identifies the drive (2.8.4.3), and its contents.
const INFO: &str = "INFO_UF2.TXT";
const BOARD: &str = "Board-ID: RPI-RP2";
/// File name on the drive. It is arbitrary: the boot ROM uses only the contents.
const NAME: &str = "palpate.uf2";

/// Whether a folder is the drive of an RP2040.
pub(super) fn is_drive(folder: &Path) -> bool {
    let info = fs::read_to_string(folder.join(INFO));
    info.is_ok_and(|text| text.lines().any(|line| line.trim() == BOARD))
}

/// Mounted drives of all boards in their boot loader.
pub(super) fn drives() -> Vec<PathBuf> {
    let mut drives = mount_points();
    drives.retain(|folder| is_drive(folder));
    drives
}

#[cfg(target_os = "linux")]
fn mount_points() -> Vec<PathBuf> {
    let mounts = fs::read_to_string("/proc/self/mounts").unwrap_or_default();
    mounted(&mounts)
}

/// Folders in a list of mounts in the format of `fstab(5)`.
#[cfg(any(target_os = "linux", test))]
fn mounted(mounts: &str) -> Vec<PathBuf> {
    let fields = mounts
        .lines()
        .map(|line| line.split(' ').collect::<Vec<_>>());
    let drives = fields.filter_map(|fields| match fields.as_slice() {
        // The boot ROM's drive is a FAT; reading others could take long.
        [_, folder, "vfat" | "msdos", ..] => Some(unescaped(folder)),
        _ => None,
    });
    drives.map(PathBuf::from).collect()
}

/// Decodes spaces and a few other characters from their octal numbers.
#[cfg(any(target_os = "linux", test))]
fn unescaped(name: &str) -> String {
    [
        ("\\040", " "),
        ("\\011", "\t"),
        ("\\012", "\n"),
        ("\\134", "\\"),
    ]
    .iter()
    .fold(name.to_owned(), |name, (code, of)| name.replace(code, of))
}

#[cfg(target_os = "macos")]
fn mount_points() -> Vec<PathBuf> {
    let entries = fs::read_dir("/Volumes").into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).collect()
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn mount_points() -> Vec<PathBuf> {
    let letters = ('A'..='Z').map(|letter| PathBuf::from(format!("{letter}:\\")));
    letters.collect()
}

/// Writes a UF2 file to the drive.
///
/// # Errors
/// If the drive does not accept all of it.
pub(super) fn write(drive: &Path, uf2: &[u8]) -> io::Result<()> {
    let mut file = File::create(drive.join(NAME))?;
    file.write_all(uf2)?;
    match file.sync_all() {
        // The board removes its drive at the last block, before the system has created the
        // directory entry.
        Err(_) if !is_drive(drive) => Ok(()),
        ended => ended,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_is_known_by_its_file_and_takes_the_firmware() {
        let folder = tempfile::tempdir().unwrap();
        let drive = folder.path();
        assert!(!is_drive(drive));
        let info = "UF2 Bootloader v3.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: RPI-RP2\r\n";
        fs::write(drive.join("INFO_UF2.TXT"), info).unwrap();
        assert!(is_drive(drive));
        write(drive, b"firmware").unwrap();
        assert_eq!(fs::read(drive.join("palpate.uf2")).unwrap(), b"firmware");
        // The drive of a Pico 2 (RP2350) is refused.
        fs::write(
            drive.join("INFO_UF2.TXT"),
            info.replace("RPI-RP2", "RP2350"),
        )
        .unwrap();
        assert!(!is_drive(drive));
    }

    #[test]
    fn drives_are_sought_where_the_system_has_mounted_a_fat() {
        let mounts = "/dev/vda / ext4 rw 0 0\n\
                      /dev/sdb1 /run/media/ann/RPI-RP2 vfat rw,nosuid 0 0\n\
                      /dev/sdc1 /media/my\\040disk vfat rw 0 0\n";
        let expected = ["/run/media/ann/RPI-RP2", "/media/my disk"];
        assert_eq!(mounted(mounts), expected.map(PathBuf::from));
    }
}
