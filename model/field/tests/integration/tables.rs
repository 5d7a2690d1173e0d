//! Materials with tables of H and B.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use palpate_field::design::{Design, builtin_text};
use palpate_field::material::Material;
use palpate_field::solve::{Accuracy, Excitation, solve};

/// A temporary folder for one test.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A law that saturates slowly. Above 1.5 T (from ν = ν₀/4 on) its magnetisation would fall, which
/// a table must not.
const LAW: &str = "initial_mu_r = 2000\nknee_T = 2.0\nexponent = 4\n";

/// The text of the built-in design `pot` with another law for its soft metal.
fn pot(law: &str) -> String {
    let text = builtin_text("pot").expect("built in");
    let old = "initial_mu_r = 1e5\nknee_T = 1.25\nexponent = 12\n";
    assert!(text.contains(old));
    text.replace(old, law)
}

/// The design `pot` with this table, in a file beside it, for its soft metal.
fn by_table(folder: &str, table: impl AsRef<[u8]>) -> Result<Design, String> {
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

/// The law as a table in steps of 0.02 T.
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

/// Invalid tables, each with the line and the words in its error message.
const REFUSED: &str = r#"
0 0⏎100 1.0⏎⏎# worse⏎90 1.1⏎ | 5: does not ascend
0;0⏎100;1.0⏎200;1.0⏎         | 3: does not ascend
100,1.0⏎1e6,1.1⏎2e6,3⏎       | 2: rises less than in vacuum
0⇥0⏎100⇥1.0⏎                 | 2: is too few points
# nothing⏎                   | 1: is too few points
0,0⏎nan,1.0⏎200,1.2⏎         | 2: is not finite
0,0⏎100,1.0⏎inf,1.2⏎         | 3: is not finite
H,B⏎100,1.0⏎200,1.2⏎         | 1: "H" is no number
1,5 0,3⏎                     | 1: has 4 columns
0,0⏎1e-12,0.2⏎100,1⏎         | 2: rises 1.6e17 times as steeply as in vacuum
0,0⏎100,1⏎4e6,5.1⏎           | 3: B of 5.1 T is that
"#;

/// A table in which line ends and tabs are visible.
fn visible(text: &str) -> String {
    text.replace('⏎', "\n")
        .replace('␍', "\r")
        .replace('⇥', "\t")
}

/// The error message names file, line, problem and what is allowed.
#[test]
fn refused_tables_name_file_and_line() {
    for row in REFUSED.trim().lines() {
        let (table, said) = row.split_once('|').expect(row);
        let refused = by_table("refused", visible(table.trim())).expect_err(row);
        let location = format!("metal.csv:{}", said.trim());
        assert!(refused.contains(&location), "{row}: {refused}");
        assert!(refused.contains("; allowed: "), "{row}: {refused}");
    }
    let long = "1 1\n".repeat(600_000);
    for (name, refused) in [
        ("long", by_table("long", &long).expect_err("long")),
        ("endless", named("endless", "/dev/zero")),
        ("folder", named("folder", ".")),
    ] {
        assert!(
            refused.contains("not a regular file, or too large"),
            "{name}: {refused}"
        );
        assert!(refused.contains("pot.toml:"), "{name}: {refused}");
    }
    let refused = named("missing", "steel.csv");
    assert!(refused.contains("material.m.bh_table: "), "{refused}");
    assert!(refused.contains("steel.csv cannot be read: "), "{refused}");
}

/// Points of a steel, H in A/m and B in T.
const STEEL: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [100.0, 0.4],
    [200.0, 1.0],
    [500.0, 1.3],
    [1000.0, 1.45],
    [5000.0, 1.62],
    [20000.0, 1.8],
    [200000.0, 2.15],
];
const MU_0: f64 = 4e-7 * std::f64::consts::PI;

/// The same steel as other programs, instruments and data sheets write it. Columns: text before the
/// rows; a row; and the result, which is either that the table is read, or the line and words of
/// the rejection. A `,` in front of a row means decimal commas.
const OF_OTHER_PROGRAMS: &str = r#"
Excel, CSV UTF-8                  | BOM                            | {A/m},{T}␍⏎        | read
Excel, CSV in German              |                                |,{A/m};{T}␍⏎        | read
LibreOffice Calc, tabs in French  |                                |,{A/m}⇥{T}⏎         | read
Excel for Macintosh, text         |                                | {A/m}⇥{T}␍         | read
MATLAB, writematrix               |                                | {A/m},{T}⏎         | read
Octave, save -text                | # name: bh⏎# rows: 8⏎# columns: 2⏎ | {A/m} {T}⏎      | read
NumPy, savetxt                    | # H B⏎                         | {A/m}e+00 {T}e+00⏎ | read
COMSOL, text                      | % H (A/m)           B (T)⏎     | {A/m}          {T}⏎ | read
gnuplot, table                    | # Curve 0 of 1, 8 points⏎      | {A/m} {T}  ⏎       | read
Excel, Unicode text               | UTF-16                         | {A/m}⇥{T}␍⏎        | 1: is UTF-16; save it as UTF-8
Excel, thousands in English       |                                | {A,m}⇥{T}⏎         | 5: has points and commas; none for thousands
Excel, thousands in French        |                                |,{A m};{T}␍⏎        | 5: has 3 columns; decimal commas with ; or tabs
NumPy, savetxt with a header      | H,B⏎                           | {A/m},{T}⏎         | 1: "H" is no number; # or % before headings
R, write.csv                      | "","H","B"⏎                    | "1",{A/m},{T}⏎     | 1: has 3 columns; # or % before headings
Ansys Maxwell, tab                | "H (A_per_meter)"⇥"B (tesla)"⏎ | {A/m}⇥{T}⏎         | 1: has 4 columns; # or % before headings
Ansys Mechanical APDL             | TB,BH,1,,8⏎                    | TBPT,,{A/m},{T}⏎   | 1: has 4 columns; two columns, H in A/m
Origin, ASCII with units          | H⇥B⏎A/m⇥T⏎                     | {A/m}⇥{T}⏎         | 1: "H" is no number; # or % before headings
GetDP and ONELAB                  | h_list() = {                   | {A/m},             | 1: columns; two columns, H in A/m
Fortran, double precision         |                                | {A/m}.0D+00 {T}⏎   | 1: "0.0D+00" is no number; two columns
FEMM, rows of its library         |                                |       {T}⇥{A/m}⏎   | 2: B of 100 T is that of no material; B in T before H in A/m: swap the columns
Elmer, H-B Curve                  |                                |   {T} {A/m}⏎       | 2: B of 100 T; swap the columns
Opera, without its first line     |                                | {G} {Oe}⏎          | 3: B - mu0 H of 2.501 T; B in G before H in Oe
Magnetics, data sheet             |                                | {Oe},{G}⏎          | 2: B of 4000 T; H in Oe and B in G
Hitachi, data sheet               |                                | {Oe},{kG}⏎         | 2: B - mu0 H of 4.000 T; H in Oe and B in kG
TDK and Ferroxcube, data sheets   |                                | {A/m};{mT}⏎        | 2: B of 400 T; H in A/m and B in mT
Magnet-Physik, Permagraph         |                                | {kA/m}⇥{T}⏎        | 3: rises 4.8e6 times; H in kA/m and B in T
Brockhaus, MPG: polarisation      |                                | {A/m}⇥{J}⏎         | 8: rises less than in vacuum; H and J = B - mu0 H
LakeShore: magnetisation          |                                | {A/m}⇥{M}⏎         | 2: is that of no material; H and M in A/m
Modelica, a branch of a loop      | -300,0.1⏎                      | {A/m},{T}⏎         | 1: does not ascend; from 0 on
WebPlotDigitizer, by a mouse      | 0.2,0.001⏎0.1,0.0011⏎          | {A/m},{T}⏎         | 2: does not ascend; above those of the point before
"#;

#[test]
fn tables_of_other_programs() {
    let written = OF_OTHER_PROGRAMS.trim().lines();
    assert_eq!(written.clone().count(), 30);
    for line in written {
        let cells: Vec<&str> = line.split('|').collect();
        let [program, before, row, expected] = cells[..] else {
            panic!("{line}");
        };
        let commas = row.starts_with(',');
        let row = visible(row[1..].trim_end());
        let row = |[h, b]: [f64; 2]| {
            let oersted = h * 4e-3 * std::f64::consts::PI;
            // Commas, or narrow blanks, as thousands separators.
            let [english, french] = [",", "\u{202f}"].map(|mark| {
                let [ones, thousands] = [h % 1e3, (h / 1e3).floor()];
                let grouped = format!("{thousands}{mark}{ones:03}");
                if h < 1e3 { h.to_string() } else { grouped }
            });
            let polarisation = ((b - MU_0 * h).min(1.78) * 1e2).floor() / 1e2;
            let values = [
                ("{A/m}", h),
                ("{kA/m}", 1e-3 * h),
                ("{Oe}", oersted),
                ("{T}", b),
                ("{mT}", 1e3 * b),
                ("{G}", 1e4 * b),
                ("{kG}", 10.0 * b),
                ("{J}", polarisation),
                ("{M}", b / MU_0 - h),
            ];
            let row = row.replace("{A,m}", &english).replace("{A m}", &french);
            let row = values.iter().fold(row, |row, (name, value)| {
                row.replace(name, &value.to_string())
            });
            if commas { row.replace('.', ",") } else { row }
        };
        let rows = STEEL.map(row).concat();
        let table = match before.trim() {
            "BOM" => format!("\u{feff}{rows}").into_bytes(),
            "UTF-16" => {
                let units = format!("\u{feff}{rows}");
                units.encode_utf16().flat_map(u16::to_le_bytes).collect()
            }
            before => (visible(before) + &rows).into_bytes(),
        };
        let design = by_table("programs", table);
        let Some((line, words)) = expected.split_once(": ") else {
            let design = design.expect(program);
            for [h, b] in STEEL {
                let found = metal(&design).reluctivity(b).nu * b;
                assert!((found - h).abs() <= 1e-9 * h, "{program}: {b} {found}");
            }
            let read = &design.files[0].summary;
            let said = "8 points to 2.15 T at 200000 A/m, where B rises 1.5 times";
            assert!(read.starts_with(said), "{program}: {read}");
            continue;
        };
        let refused = design.map(|_| ()).expect_err(program);
        let location = format!("metal.csv:{}: ", line.trim());
        for words in words.split("; ").chain([location.as_str()]) {
            assert!(refused.contains(words), "{program}, {words}: {refused}");
        }
    }
}

/// A table that ends before saturation is read, but with a note that its H may be in kA/m.
#[test]
fn a_table_that_ends_unsaturated_says_so() {
    let doubt = "(so it ends before saturation, or H is not in A/m)";
    for (unit, doubted) in [(1.0, false), (1e-2, true)] {
        let table: String = STEEL.map(|[h, b]| format!("{} {b}\n", unit * h)).concat();
        let design = by_table("unsaturated", table).expect("a design");
        let read = design.files[0].to_string();
        assert_eq!(read.contains(doubt), doubted, "{read}");
    }
}

/// Curves with sharp knees are solved within a known time: 17 s at most on two cores.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_sharp_knee_is_solved_in_seconds() {
    for (table, current_a) in [
        ("0.25,0.3\n10,0.57\n1e5,0.7\n", 10.0),
        ("2,0.4\n1e5,0.53\n", 100.0),
        ("0.1,0.5\n200,0.51\n1e5,0.64\n", 100.0),
    ] {
        let design = by_table("knee", table).expect("a design");
        let excitation = Excitation::saturating(&design, current_a);
        let solved = solve(&design, &excitation, &Accuracy::default()).expect("a field");
        println!("{table:?} at {current_a} A: {:?}", solved.report);
        assert!(solved.report.reached, "{:?}", solved.report);
        assert!(solved.report.unknowns < 60_000, "{:?}", solved.report);
    }
}

/// A field beyond the last point is reported with the part and the excess; a field within the table
/// is not.
#[test]
fn a_field_beyond_the_table_is_said() {
    let (ends_t, rows) = (0.8, 2 + 40);
    let table: Vec<String> = sampled().lines().take(rows).map(str::to_owned).collect();
    let design = by_table("beyond", table.join("\n")).expect("a design");
    let beyond = |excitation: &Excitation| {
        let solved = solve(&design, excitation, &Accuracy::default()).expect("a field");
        (solved.beyond_tables(&design), solved.figures.plate_max_t)
    };
    for within in [
        Excitation::small(&design, 1e3),
        Excitation::saturating(&design, 10.0),
    ] {
        assert_eq!(beyond(&within).0, []);
    }
    let (parts, greatest_t) = beyond(&Excitation::saturating(&design, 60.0));
    let most = parts.iter().map(|part| part.greatest_t).fold(0.0, f64::max);
    assert!(most > ends_t && most == greatest_t, "{parts:?}");
    for part in &parts {
        assert!(!design.parts[part.part].cast && part.ends_t == ends_t);
    }
}

/// The error message about a table with this name.
fn named(folder: &str, table: &str) -> String {
    let file = self::folder(folder).join("pot.toml");
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[core]\nr = 1.0\nx = [0, 1]\n[material.m]\nbh_table = {table:?}\n"
    );
    let refused = Design::parse(&file.display().to_string(), &text);
    refused.map(|_| ()).expect_err(table).to_string()
}
