//! Installs and runs the compared programs.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use palpate_cli::failure::Failure;
use serde_json::Value;

use super::cases::Case;
use super::result::{Compared, PeerResult};
use super::with_getdp;
use crate::{python, tool};

/// Folder of decks and results, in the folder of the run.
const FOLDER: &str = "target/field-peers";

/// Installed version of NGSolve, so that the figures can be reproduced.
const NGSOLVE: &str = "ngsolve==6.2.2608";

/// Sizes of NGSolve's triangles about the core, mm, coarse to fine.
const NGSOLVE_SIZES: [f64; 5] = [8.0, 4.0, 2.0, 1.0, 0.5];
const GETDP_SIZES: [f64; 4] = [0.8, 0.4, 0.2, 0.1];

/// Sizes of GetDP's triangles in designs with plates, mm; the meshes are graded towards the plates.
const GETDP_SIZES_WITH_PLATES: [f64; 3] = [0.8, 0.4, 0.2];

/// Sizes of GetDP's triangles with saturation, mm. The damped Newton method takes dozens of
/// solutions on each mesh; size 0.2 would take six minutes.
const GETDP_SIZES_SATURATING: [f64; 2] = [0.8, 0.4];

/// Cost of a command.
struct Usage {
    wall_s: f64,
    peak_mb: f64,
}

/// Installs Gmsh and GetDP from Debian.
fn install_tools() -> Result<(), Failure> {
    let tools = ["gmsh", "getdp"];
    // Running them is no test: GetDP prints its version and fails.
    if tool::printed(Command::new("which").args(tools)).is_err() {
        let mut install = Command::new("apt-get");
        tool::printed(install.args(["install", "-y"]).args(tools))?;
    }
    Ok(())
}

pub(super) fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Context of a comparison.
pub(super) struct PeerBench {
    python: String,
    /// This program, which runs the tool.
    program: String,
    folder: PathBuf,
}

impl PeerBench {
    /// Installs missing programs, and writes the scripts.
    pub(super) fn prepare() -> Result<Self, Failure> {
        let folder = env::current_dir()?.join(FOLDER);
        fs::create_dir_all(&folder)?;
        install_tools()?;
        let bench = Self {
            python: python::with_packages(&folder, &[NGSOLVE])?,
            program: text(&env::current_exe()?),
            folder,
        };
        bench.write("measure.py", include_str!("measure.py"))?;
        bench.write("with_ngsolve.py", include_str!("with_ngsolve.py"))?;
        bench.write("lean_with_ngsolve.py", include_str!("lean_with_ngsolve.py"))?;
        Ok(bench)
    }

    /// Runs one of the scripts with these arguments, and returns what it prints.
    pub(super) fn script(&self, name: &str, arguments: &[&str]) -> Result<String, Failure> {
        let mut python = Command::new(&self.python);
        tool::printed(python.arg(self.folder.join(name)).args(arguments))
    }

    pub(super) fn compare(&self, case: &Case) -> Result<Compared, Failure> {
        Ok(Compared {
            case: *case,
            ours: self.palpate(case, &[])?,
            truth: self.palpate(case, &["--accuracy", "3e-6", "--order", "4"])?,
            ngsolve: self.ngsolve(case)?,
            getdp: self.getdp(case)?,
        })
    }

    pub(super) fn write(&self, name: &str, contents: &str) -> Result<String, Failure> {
        let path = self.folder.join(name);
        fs::write(&path, contents)?;
        Ok(text(&path))
    }

    /// Runs a command under `measure.py`; returns its output, time and memory.
    fn measured(&self, command: &[&str]) -> Result<(String, Usage), Failure> {
        let printed = self.script("measure.py", command)?;
        let (printed, usage) = printed
            .trim_end()
            .rsplit_once('\n')
            .ok_or_else(|| Failure::refused("measure.py printed one line"))?;
        let usage = serde_json::from_str(usage)?;
        let usage = Usage {
            wall_s: number(&usage, "command_s")?,
            peak_mb: number(&usage, "peak_MB")?,
        };
        Ok((printed.to_owned(), usage))
    }

    /// Best of three runs of palpate, including the program's start. With saturation, the time
    /// includes the solution per ampere, which the tool also computes.
    pub(super) fn palpate(&self, case: &Case, more: &[&str]) -> Result<PeerResult, Failure> {
        let mut best = self.palpate_once(case, more)?;
        for _ in 1..3 {
            let found = self.palpate_once(case, more)?;
            if found.wall_s < best.wall_s {
                best = found;
            }
        }
        Ok(best)
    }

    /// One run of palpate, as a user calls it.
    pub(super) fn palpate_once(&self, case: &Case, more: &[&str]) -> Result<PeerResult, Failure> {
        let current = case.current_a().to_string();
        let mut command = vec![
            &*self.program,
            tool::TOOL,
            "field",
            "solve",
            case.name,
            "--json",
        ];
        if case.saturates {
            command.extend(["--current", &current]);
        }
        command.extend(more);
        let (printed, usage) = self.measured(&command)?;
        ours(case, &serde_json::from_str(&printed)?, &usage)
    }

    fn ngsolve(&self, case: &Case) -> Result<Vec<PeerResult>, Failure> {
        let script = text(&self.folder.join("with_ngsolve.py"));
        let mut rows = Vec::new();
        for size in NGSOLVE_SIZES {
            let name = format!("{}.json", case.name);
            let deck = self.write(&name, &serde_json::to_string(&case.json(&[size]))?)?;
            let (printed, usage) = self.measured(&[&self.python, &script, &deck])?;
            let line = printed.lines().find(|line| line.starts_with('{'));
            let result: Value = serde_json::from_str(line.unwrap_or_default())?;
            rows.push(PeerResult {
                wall_s: number(&result, "wall_s")?,
                peak_mb: usage.peak_mb,
                core_mean_t: number(&result, "core_mean_T")?,
                centre_t: number(&result, "centre_T")?,
                inductance_h: number(&result, "inductance_H")?,
            });
        }
        Ok(rows)
    }

    fn getdp(&self, case: &Case) -> Result<Vec<PeerResult>, Failure> {
        let sizes: &[f64] = match case {
            Case {
                saturates: true, ..
            } => &GETDP_SIZES_SATURATING,
            case if case.plates.is_empty() => &GETDP_SIZES,
            _ => &GETDP_SIZES_WITH_PLATES,
        };
        sizes
            .iter()
            .map(|&size| self.getdp_once(case, size))
            .collect()
    }

    fn getdp_once(&self, case: &Case, size: f64) -> Result<PeerResult, Failure> {
        let geometry = self.write(
            "case.geo",
            &with_getdp::geometry(case, size).map_err(Failure::refused)?,
        )?;
        let problem = self.write("case.pro", &with_getdp::problem(case))?;
        let mesh = text(&self.folder.join("case.msh"));
        let (_, meshed) =
            self.measured(&["gmsh", "-2", &geometry, "-o", &mesh, "-format", "msh2"])?;
        let (_, solved) = self.measured(&[
            "getdp", &problem, "-msh", &mesh, "-solve", "Field", "-pos", "Sums", "-v", "0",
        ])?;
        let read = |name: &str| -> Result<Vec<f64>, Failure> {
            let path = self.folder.join(format!("{name}.txt"));
            let text = fs::read_to_string(&path)?;
            fs::remove_file(&path)?;
            let numbers = text.split_whitespace().map(str::parse);
            numbers.collect::<Result<_, _>>().map_err(Failure::refused)
        };
        // Reads the number at a position counted from the end of a file.
        let last = |name: &str, place: usize| -> Result<f64, Failure> {
            let numbers = read(name)?;
            let number = numbers.into_iter().rev().nth(place);
            number.ok_or_else(|| Failure::refused(format!("GetDP wrote too little to {name}.txt")))
        };
        let centre = last("centre", 1)?;
        let [volume, first, linkage] = [last("volume", 0)?, last("first", 0)?, last("linkage", 0)?];
        Ok(PeerResult {
            wall_s: meshed.wall_s + solved.wall_s,
            peak_mb: meshed.peak_mb.max(solved.peak_mb),
            core_mean_t: first / volume,
            // GetDP's third axis points against the current's.
            centre_t: -centre,
            // GetDP omits the factor 2 pi.
            inductance_h: std::f64::consts::TAU * linkage / case.current_a(),
        })
    }
}

fn ours(case: &Case, document: &Value, usage: &Usage) -> Result<PeerResult, Failure> {
    let (figures, mean, centre) = if case.saturates {
        (&document["at_current"], "core_mean_T", "centre_T")
    } else {
        (document, "core_mean_T_per_A", "centre_T_per_A")
    };
    Ok(PeerResult {
        wall_s: usage.wall_s,
        peak_mb: usage.peak_mb,
        core_mean_t: number(figures, mean)?,
        centre_t: number(figures, centre)?,
        inductance_h: number(document, "inductance_H")?,
    })
}

pub(super) fn number(value: &Value, key: &str) -> Result<f64, Failure> {
    let number = value[key].as_f64();
    number.ok_or_else(|| Failure::refused(format!("there is no number {key:?} in {value}")))
}
