//! Installs and runs the compared programs.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::cases::Case;
use super::result::{Compared, PeerResult};
use super::with_getdp;
use crate::process::{Invocation, Workspace};
use crate::tool;

/// Folder of decks and results, in the workspace.
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
pub(super) struct Usage {
    pub(super) wall_s: f64,
    pub(super) peak_mb: f64,
}

/// Installs tools from Debian.
fn install_tools(workspace: &Workspace, tools: &[&str]) -> Result<()> {
    let there = |tool: &&str| {
        // Running them is no test: GetDP prints its version and fails.
        let asked = Invocation::new("which", &[tool]);
        workspace.succeeds(&asked)
    };
    if !tools.iter().all(there) {
        let install = Invocation::new("apt-get", &[&["install", "-y"], tools].concat());
        workspace
            .run(&install)
            .with_context(|| format!("run `{install}` as root, then this again"))?;
    }
    Ok(())
}

/// Creates a virtual environment with NGSolve.
fn install_ngsolve(workspace: &Workspace, folder: &Path) -> Result<PathBuf> {
    let environment = folder.join("venv");
    let python = environment.join("bin/python");
    if !python.exists() {
        let create = Invocation::new("python3", &["-m", "venv", &text(&environment)?]);
        workspace.run(&create)?;
    }
    let python_text = text(&python)?;
    workspace.run(&Invocation::new(
        &python_text,
        &["-m", "pip", "install", "--quiet", NGSOLVE],
    ))?;
    Ok(python)
}

pub(super) fn text(path: &Path) -> Result<String> {
    let text = path.to_str().context("the path is not UTF-8")?;
    Ok(text.to_owned())
}

/// Context of a comparison.
pub(super) struct PeerBench<'w> {
    pub(super) workspace: &'w Workspace,
    pub(super) python: String,
    pub(super) palpate: String,
    pub(super) folder: PathBuf,
}

impl<'w> PeerBench<'w> {
    /// Installs missing programs, including these tools from Debian.
    pub(super) fn prepare(
        workspace: &'w Workspace,
        python: Option<PathBuf>,
        tools: &[&str],
    ) -> Result<Self> {
        let folder = workspace.root().join(FOLDER);
        fs::create_dir_all(&folder).with_context(|| format!("{FOLDER} could not be created"))?;
        install_tools(workspace, tools)?;
        let python = match python {
            Some(python) => python,
            None => install_ngsolve(workspace, &folder)?,
        };
        let bench = Self {
            workspace,
            python: text(&python)?,
            palpate: text(&tool::build(workspace)?)?,
            folder,
        };
        bench.write("measure.py", include_str!("measure.py"))?;
        Ok(bench)
    }
}

impl PeerBench<'_> {
    pub(super) fn compare(&self, case: &Case) -> Result<Compared> {
        Ok(Compared {
            case: *case,
            ours: self.palpate(case, &[])?,
            truth: self.palpate(case, &["--accuracy", "3e-6", "--order", "4"])?,
            ngsolve: self.ngsolve(case)?,
            getdp: self.getdp(case)?,
        })
    }

    pub(super) fn write(&self, name: &str, text: &str) -> Result<String> {
        let path = self.folder.join(name);
        fs::write(&path, text).with_context(|| format!("{name} could not be written"))?;
        self::text(&path)
    }

    /// Runs a command under `measure.py`; returns its output, time and memory.
    pub(super) fn measured(&self, command: &[&str]) -> Result<(String, Usage)> {
        let script = text(&self.folder.join("measure.py"))?;
        let mut arguments = vec![script.as_str()];
        arguments.extend(command);
        let printed = self
            .workspace
            .output(&Invocation::new(&self.python, &arguments))?;
        let (printed, usage) = printed
            .trim_end()
            .rsplit_once('\n')
            .context("measure.py printed one line")?;
        let usage = serde_json::from_str(usage)?;
        let usage = Usage {
            wall_s: number(&usage, "command_s")?,
            peak_mb: number(&usage, "peak_MB")?,
        };
        Ok((printed.to_owned(), usage))
    }

    /// Best of three runs of palpate, including the program's start. With saturation, the time
    /// includes the solution per ampere, which the tool also computes.
    pub(super) fn palpate(&self, case: &Case, more: &[&str]) -> Result<PeerResult> {
        let current = case.current_a().to_string();
        let mut command = vec![&*self.palpate, "field", "solve", case.name, "--json"];
        if case.saturates {
            command.extend(["--current", &current]);
        }
        command.extend(more);
        let mut best: Option<PeerResult> = None;
        for _ in 0..3 {
            let (printed, usage) = self.measured(&command)?;
            let found = ours(case, &serde_json::from_str(&printed)?, &usage)?;
            if best.is_none_or(|best| found.wall_s < best.wall_s) {
                best = Some(found);
            }
        }
        best.context("no run")
    }

    fn ngsolve(&self, case: &Case) -> Result<Vec<PeerResult>> {
        let script = text(&self.folder.join("with_ngsolve.py"))?;
        let mut rows = Vec::new();
        for size in NGSOLVE_SIZES {
            let name = format!("{}.json", case.name);
            let deck = self.write(&name, &serde_json::to_string(&case.json(&[size]))?)?;
            let (printed, usage) = self.measured(&[&self.python, &script, &deck])?;
            let line = printed.lines().find(|line| line.starts_with('{'));
            let result: Value = serde_json::from_str(line.context("NGSolve printed no result")?)?;
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

    fn getdp(&self, case: &Case) -> Result<Vec<PeerResult>> {
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

    fn getdp_once(&self, case: &Case, size: f64) -> Result<PeerResult> {
        let geometry = self.write("case.geo", &with_getdp::geometry(case, size)?)?;
        let problem = self.write("case.pro", &with_getdp::problem(case))?;
        let mesh = text(&self.folder.join("case.msh"))?;
        let (_, meshed) =
            self.measured(&["gmsh", "-2", &geometry, "-o", &mesh, "-format", "msh2"])?;
        let (_, solved) = self.measured(&[
            "getdp", &problem, "-msh", &mesh, "-solve", "Field", "-pos", "Sums", "-v", "0",
        ])?;
        let read = |name: &str| -> Result<Vec<f64>> {
            let path = self.folder.join(format!("{name}.txt"));
            let text = fs::read_to_string(&path)
                .with_context(|| format!("GetDP wrote no {name}.txt for {}", case.name))?;
            fs::remove_file(&path)?;
            text.split_whitespace()
                .map(|word| word.parse().context("GetDP wrote no number"))
                .collect()
        };
        let last = |name: &str| -> Result<f64> {
            let numbers = read(name)?;
            numbers.last().copied().context("an empty file")
        };
        let centre = read("centre")?;
        let [volume, first, linkage] = [last("volume")?, last("first")?, last("linkage")?];
        Ok(PeerResult {
            wall_s: meshed.wall_s + solved.wall_s,
            peak_mb: meshed.peak_mb.max(solved.peak_mb),
            core_mean_t: first / volume,
            // GetDP's third axis points against the current's.
            centre_t: -*centre
                .get(centre.len().wrapping_sub(2))
                .context("no field")?,
            // GetDP omits the factor 2 pi.
            inductance_h: std::f64::consts::TAU * linkage / case.current_a(),
        })
    }
}

pub(super) fn ours(case: &Case, document: &Value, usage: &Usage) -> Result<PeerResult> {
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

pub(super) fn number(value: &Value, key: &str) -> Result<f64> {
    value[key]
        .as_f64()
        .with_context(|| format!("there is no number {key:?} in {value}"))
}
