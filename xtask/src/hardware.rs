//! `cargo xtask ci --only hardware`: the carrier board by KiCad's rules, and the boards, drawings and moulds of
//! `palpate field export` and `palpate plan-touch` as KiCad, ezdxf, trimesh and shapely read them.
//!
//! KiCad 9 has to be there; the Python packages are installed as for the step `python`.

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};
use crate::python::{Environment, build_tool, text};

const ENVIRONMENT: Environment = Environment {
    folder: "target/hardware",
    packages: "hardware/requirements.txt",
};
/// KiCad's module belongs to the system's Python, whichever is first on PATH.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";
const INSTALL: &str = "install KiCad 9 with its footprints and its Python module; on Debian 12, with backports among apt's sources: \
                       `apt-get install --no-install-recommends -t bookworm-backports kicad kicad-footprints`";

/// Makes the board and checks it, and then the exports.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let version = workspace.output(&Invocation::new("kicad-cli", &["version"]));
    let version = version.context(INSTALL)?;
    if !version.trim().starts_with("9.") {
        bail!("KiCad is {}: {INSTALL}", version.trim());
    }
    let script = |python: &str, arguments: &[&str]| {
        workspace.run(&Invocation::new(python, &[&["-B"], arguments].concat()))
    };
    script(SYSTEM_PYTHON, &["-c", "import pcbnew"]).context(INSTALL)?;
    script(SYSTEM_PYTHON, &["hardware/board.py"])?;
    script(SYSTEM_PYTHON, &["hardware/check.py"])?;
    let tool = text(&build_tool(workspace)?)?;
    let python = ENVIRONMENT.install(workspace)?;
    script(&python, &["hardware/check_exports.py", &tool])?;
    Ok("KiCad finds nothing, and others read what is exported".to_owned())
}
