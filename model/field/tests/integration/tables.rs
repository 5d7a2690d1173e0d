//! Materials by tables of H and B.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use palpate_field::design::{Design, builtin_text};
use palpate_field::figures::Figures;
use palpate_field::material::Material;
use palpate_field::solve::{Accuracy, Excitation, solve};

/// A folder of its own for each test.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A law that saturates slowly. From ν = ν₀/4 on, at 1.5 T, its magnetisation would fall: no table has that.
const LAW: &str = "initial_mu_r = 2000\nknee_T = 2.0\nexponent = 4\n";
const LAW_ENDS_T: f64 = 1.5;

/// The text of the built-in design `pot` with another law of its soft metal.
fn pot(law: &str) -> String {
    let text = builtin_text("pot").expect("built in");
    let old = "initial_mu_r = 1e5\nknee_T = 1.25\nexponent = 12\n";
    assert!(text.contains(old));
    text.replace(old, law)
}

/// `pot` with its soft metal by a table beside it.
fn by_table(folder: &str, table: &str) -> Result<Design, String> {
    let folder = self::folder(folder);
    fs::write(folder.join("metal.csv"), table).expect("a table");
    let file = folder.join("pot.toml");
    let text = pot("bh_table = \"metal.csv\"\n");
    Design::parse(&file.display().to_string(), &text).map_err(|error| error.to_string())
}

fn by_law() -> Design {
    Design::parse("pot.toml", &pot(LAW)).expect("a design")
}

fn metal(design: &Design) -> &Material {
    let metal = design.parts.iter().find(|part| !part.cast);
    &metal.expect("a plate").material
}

/// The law at steps of 0.02 T.
fn sampled() -> String {
    let design = by_law();
    let mut table = "# H in A/m, B in T\n\n".to_owned();
    for step in 1..=75 {
        let b_t = 0.02 * f64::from(step);
        let h = metal(&design).reluctivity(b_t).nu * b_t;
        writeln!(table, "{h:e}, {b_t}").expect("a row");
    }
    table
}

/// A table of the analytic law gives the figures of the law, far below saturation and in it.
#[test]
fn a_sampled_law_gives_the_law_s_figures() {
    let law = by_law();
    let table = by_table("sampled", &sampled()).expect("a design");
    for current_a in [1.0, 10.0, 60.0] {
        let [law, table] = [&law, &table].map(|design| {
            let excitation = Excitation::saturating(design, current_a);
            solve(design, &excitation, &Accuracy::default()).expect("a field")
        });
        assert!(table.report.newton_iterations <= 6, "{:?}", table.report);
        assert!(law.figures.plate_max_t < LAW_ENDS_T, "{:?}", law.figures);
        for figure in [
            |figures: &Figures| figures.centre_t,
            |figures: &Figures| figures.core_mean_t,
            |figures: &Figures| figures.linkage_wb,
            |figures: &Figures| figures.force_n,
        ] {
            let miss = figure(&table.figures) / figure(&law.figures) - 1.0;
            println!(
                "a table at {current_a} A: off by {miss:.1e}; {:.3} T",
                law.figures.plate_max_t
            );
            assert!(miss.abs() < 1e-5, "{current_a} A: {miss:e}");
        }
    }
}

/// The differential permeability is what B rises by with H, along the field; across it B/H.
#[test]
fn the_differential_permeability_is_a_difference_quotient() {
    let table = by_table("quotient", &sampled()).expect("a design");
    let h = |b_t: f64| metal(&table).reluctivity(b_t).nu * b_t;
    for b_t in [0.011, 0.31, 0.999, 1.25, 1.4, 2.2] {
        let step = 1e-5;
        let quotient = (h(b_t + step) - h(b_t - step)) / (2.0 * step);
        let [[across, _], [_, along]] = metal(&table).reluctivity(b_t).differential([0.0, b_t]);
        assert!(
            (along / quotient - 1.0).abs() < 1e-4,
            "{b_t}: {along:e} {quotient:e}"
        );
        assert!((across / (h(b_t) / b_t) - 1.0).abs() < 1e-12, "{b_t}");
    }
}

/// The file and the line of what is wrong, and what is allowed.
#[test]
fn refused_tables_name_file_and_line() {
    for (name, table, line, problem) in [
        (
            "order",
            "0 0\n100 1.0\n\n# worse\n90 1.1\n",
            5,
            "does not ascend",
        ),
        ("flat", "0;0\n100;1.0\n200;1.0\n", 3, "does not ascend"),
        (
            "vacuum",
            "100,1.0\n1e6,1.1\n2e6,3\n",
            2,
            "rises less than in vacuum",
        ),
        ("few", "0\t0\n100\t1.0\n", 2, "is too few points"),
        ("empty", "# nothing\n", 1, "is too few points"),
        ("nan", "0,0\nnan,1.0\n200,1.2\n", 2, "is not finite"),
        ("infinite", "0,0\n100,1.0\ninf,1.2\n", 3, "is not finite"),
        ("header", "H,B\n100,1.0\n200,1.2\n", 1, "\"H\" is no number"),
        ("columns", "1,5 0,3\n", 1, "has 4 columns"),
    ] {
        let refused = by_table(name, table).expect_err(name);
        let location = format!("metal.csv:{line}: {problem}");
        assert!(refused.contains(&location), "{name}: {refused}");
        assert!(refused.contains("; allowed: "), "{name}: {refused}");
    }
    let long = "1 1\n".repeat(600_000);
    for (name, refused) in [
        ("long", by_table("long", &long).expect_err("long")),
        ("endless", named("endless", "/dev/zero")),
        ("folder", named("folder", ".")),
    ] {
        assert!(
            refused.contains("no plain file, or too large"),
            "{name}: {refused}"
        );
        assert!(refused.contains("pot.toml:"), "{name}: {refused}");
    }
    let refused = named("missing", "steel.csv");
    assert!(refused.contains("material.m.bh_table: "), "{refused}");
    assert!(refused.contains("steel.csv cannot be read: "), "{refused}");
}

/// What is said of a table by this name.
fn named(folder: &str, table: &str) -> String {
    let file = self::folder(folder).join("pot.toml");
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[core]\nr = 1.0\nx = [0, 1]\n[material.m]\nbh_table = {table:?}\n"
    );
    let refused = Design::parse(&file.display().to_string(), &text);
    refused.map(|_| ()).expect_err(table).to_string()
}
