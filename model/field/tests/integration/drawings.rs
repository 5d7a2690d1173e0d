//! Outlines from DXF drawings.

use std::fs;
use std::path::PathBuf;

use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;
use proptest::prelude::*;

/// A ball of mu_r 3.7 in a field of 1 mT, drawn on the layer `ball` of a file in a folder of its
/// own.
fn design(folder: &str, drawing: &str) -> Result<Design, String> {
    design_of(folder, drawing, "layer = \"ball\"")
}

/// The ball of [`design`]; `beside` is further text after the drawing's name.
fn design_of(folder: &str, drawing: impl AsRef<[u8]>, beside: &str) -> Result<Design, String> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("core.dxf"), drawing).expect("a drawing");
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[background]\nfield_T = 1e-3\n[core]\nr = 5.0\nx = [-5.0, 5.0]\n\
         [material.m]\nmu_r = 3.7\n[[body]]\nname = \"b\"\nmaterial = \"m\"\n\
         shape = {{ outline_dxf = \"core.dxf\", {beside} }}\n"
    );
    let file = folder.join("ball.toml").display().to_string();
    Design::parse(&file, &text).map_err(|error| error.to_string())
}

/// A drawing as programs write it, with header, tables and entities. In the arguments, each line is
/// one group: its code and its value.
fn drawing(unit: &str, entities: &str) -> String {
    let groups = format!(
        "0 SECTION\n2 HEADER\n9 $ACADVER\n1 AC1015\n9 $INSUNITS\n70 {unit}\n0 ENDSEC\n\
         0 SECTION\n2 TABLES\n0 TABLE\n2 LAYER\n0 LAYER\n2 ball\n70 0\n0 ENDTAB\n0 ENDSEC\n\
         0 SECTION\n2 ENTITIES\n{entities}0 ENDSEC\n0 EOF\n"
    );
    ended(&groups, "\r\n")
}

/// The text of a drawing with these groups and the line ending `end`.
fn ended(groups: &str, end: &str) -> String {
    let group = |group: &str| {
        let (code, value) = group.split_once(' ').unwrap_or((group, ""));
        format!("{code:>3}{end}{value}{end}")
    };
    groups.lines().map(group).collect()
}

/// A half-circle of 10 mm about the origin, in a given unit.
fn half_circle(radius: f64) -> String {
    format!(
        "0 TEXT\n8 notes\n1 the ball\n0 ARC\n5 1F\n100 AcDbEntity\n8 ball\n100 AcDbCircle\n10 0.0\n20 0.0\n30 0.0\n\
         40 {radius}\n100 AcDbArc\n50 270.0\n51 90.0\n"
    )
}

/// The outline is open along the axis; it is drawn in millimetres, metres, inches, and in the
/// design's unit.
#[test]
fn a_drawn_ball_is_half_a_disc() {
    for (unit, radius) in [("4", 10.0), ("6", 0.01), ("1", 10.0 / 25.4), ("0", 10.0)] {
        let text = drawing(unit, &half_circle(radius));
        let design = design(&format!("ball-{unit}"), &text).expect("a design");
        let ball = &design.parts[0].shape;
        let miss = ball.area_m2() / (0.5e-4 * std::f64::consts::PI) - 1.0;
        assert!(miss.abs() < 1e-9, "{unit}: {miss:e}");
        assert!(ball.contains([9.99e-3, 0.0]) && !ball.contains([7.1e-3, 7.1e-3]));
    }
}

/// A slot of 4 x 2 mm with round ends, from 8 to 14 mm, as lines, arcs, or a polyline with bulges.
fn slot() -> [Vec<String>; 2] {
    let line = |from: [f64; 2], to: [f64; 2]| {
        format!(
            "0 LINE\n8 ball\n10 {}\n20 {}\n11 {}\n21 {}\n",
            from[0], from[1], to[0], to[1]
        )
    };
    let arc = |r: f64, start: f64| {
        format!(
            "0 ARC\n8 ball\n10 {r}\n20 3\n40 1\n50 {start}\n51 {}\n",
            start + 180.0
        )
    };
    let parts = vec![
        line([9.0, 2.0], [13.0, 2.0]),
        arc(13.0, 270.0),
        line([13.0, 4.0], [9.0, 4.0]),
        arc(9.0, 90.0),
    ];
    let polyline = "0 LWPOLYLINE\n8 ball\n90 4\n70 1\n43 0.0\n10 9\n20 2\n10 13\n20 2\n42 1.0\n10 13\n20 4\n42 1e-12\n\
                    10 9\n20 4\n42 1\n";
    [parts, vec![polyline.to_owned()]]
}

fn shape(folder: &str, entities: &str) -> Shape {
    let design = design(folder, &drawing("4", entities)).expect("a design");
    design.parts[0].shape.clone()
}

fn is_slot(shape: &Shape) {
    let exact_m2 = (8.0 + std::f64::consts::PI) * 1e-6;
    let miss = shape.area_m2() / exact_m2 - 1.0;
    assert!(miss.abs() < 1e-9, "{miss:e} {shape:?}");
    for (point, inside) in [
        ([8.1e-3, 3e-3], true),
        ([13.9e-3, 3e-3], true),
        ([8.1e-3, 3.9e-3], false),
    ] {
        assert_eq!(shape.contains(point), inside, "{point:?} {shape:?}");
    }
}

#[test]
fn a_polyline_is_its_lines_and_arcs() {
    for (index, entities) in slot().iter().enumerate() {
        is_slot(&shape(&format!("slot-{index}"), &entities.concat()));
    }
    // A circle, and entities in paper space or on another layer, which are ignored.
    let more = "0 LINE\n8 ball\n67 1\n10 0\n20 0\n11 9\n21 9\n0 SPLINE\n8 notes\n0 CIRCLE\n8 ball\n10 20\n20 0\n40 2\n";
    let circle = shape("circle", more);
    assert!((circle.area_m2() / (4e-6 * std::f64::consts::PI) - 1.0).abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 50, failure_persistence: None, ..ProptestConfig::default() })]

    /// Sides are found in any order and in either direction.
    #[test]
    fn the_order_of_the_sides_does_not_matter(
        parts in Just(slot()[0].clone()).prop_shuffle(),
        turned in any::<[bool; 4]>(),
    ) {
        let turn = |(part, turned): (&String, bool)| {
            if turned && part.contains("LINE") {
                let names = [("\n10 ", "\na "), ("\n20 ", "\nb "), ("\n11 ", "\n10 "), ("\n21 ", "\n20 "), ("\na ", "\n11 "), ("\nb ", "\n21 ")];
                names.iter().fold(part.clone(), |part, (from, to)| part.replace(from, to))
            } else {
                part.clone()
            }
        };
        let parts: String = parts.iter().zip(turned).map(turn).collect();
        is_slot(&shape("order", &parts));
    }
}

/// Invalid entities, with a comma between groups; the line of the drawing and the words in the
/// error message. 18 groups precede the first entity, so its name is on line 38.
const REFUSED: &str = r#"
0 LINE,8 ball,10 9,20 2,11 9,21 2       | 38: has no length; allowed: lines and arcs with a length
0 LINE,8 other                          | 1: there is nothing on the layer "ball"; allowed: a layer that is drawn on: other
OPEN                                    | 64: the outline is open by 2.0000 mm, near r = 9.0000 mm, x = 2.0000 mm and near r = 9.0000 mm, x = 4.0000 mm
SLOT,0 LINE,8 ball,10 9,20 2,11 9,21 4  | 90: three sides meet near r = 9.0000 mm
SLOT,0 CIRCLE,8 ball,10 20,20 0,40 2    | 90: belongs to no outline with the rest
0 LINE,8 ball,10 x,20 2,11 9,21 4       | 42: "x" of LINE is no number
0 LINE,8 ball,10 1e5,20 2,11 9,21 4     | 38: 100 m is out of range
0 LINE,8 ball,10 1,20 2,11 9            | 38: LINE without group 21
0 ARC,8 ball,10 5,20 2,40 1,50 10,51 10 | 38: ARC without length
0 CIRCLE,8 ball,10 0,20 2,40 1          | 38: lies below the axis, near r = -1.0000 mm
0 LINE,8 ball,10 -1,20 2,11 9,21 4      | 38: lies below the axis
0 LINE,8 ball,10 1,20 2,11 9,B 4        | 47: "B" is no group code
"#;

#[test]
fn drawings_that_make_no_outline_are_refused() {
    let [parts, _] = slot();
    let all = parts.concat();
    for row in REFUSED.trim().lines() {
        let (groups, said) = row.split_once('|').expect(row);
        let (line, problem) = said.trim().split_once(": ").expect(row);
        let entities = groups.trim().replace(',', "\n") + "\n";
        let entities = entities
            .replace("OPEN\n", &parts[..3].concat())
            .replace("SLOT\n", &all);
        let refused = design("refused", &drawing("4", &entities)).expect_err(row);
        assert!(refused.contains(problem), "{row}: {refused}");
        let place = format!("core.dxf:{line}: ");
        assert!(refused.contains(&place), "{row}: {refused}");
    }
    let refused = design("refused", &drawing("3", &all)).expect_err("miles");
    assert!(
        refused.contains("core.dxf:12: $INSUNITS is \"3\"; allowed: 0")
            && refused.contains("or a drawing_unit beside outline_dxf"),
        "{refused}"
    );
    let refused = design("refused", "AutoCAD Binary DXF\r\n\u{1a}\0").expect_err("binary");
    assert!(
        refused.contains("core.dxf:1: is a binary DXF file"),
        "{refused}"
    );
}

/// The message states the size of a gap, also if the outline is open along the axis.
#[test]
fn a_gap_is_named_with_its_size() {
    let arc =
        |from: f64, to: f64| format!("0 ARC\n8 ball\n10 0\n20 0\n40 10\n50 {from}\n51 {to}\n");
    let short_of_0 = -(0.02_f64 / 10.0).to_degrees();
    for (name, entities, problem) in [
        (
            "gap in the middle",
            arc(-90.0, short_of_0) + &arc(0.0, 90.0),
            "the outline has a gap of 0.0200 mm, near r = 10.0000 mm, x = 0.0000 mm",
        ),
        (
            "gap at the axis",
            "0 ARC\n8 ball\n10 0.02\n20 0\n40 10\n50 270\n51 90\n".to_owned(),
            "the outline is open by 20.0000 mm, near r = 0.0200 mm",
        ),
    ] {
        let refused = design("gap", &drawing("4", &entities)).expect_err(name);
        assert!(refused.contains(problem), "{name}: {refused}");
        let allowed = "allowed: lines and arcs that meet within 0.1 um, or end on the axis, r = 0";
        assert!(refused.contains(allowed), "{name}: {refused}");
    }
}

/// The summary states the size and the source of the unit; the design overrides the drawing's unit.
#[test]
fn the_design_overrides_the_unit_of_a_drawing() {
    let drawing = drawing("6", &half_circle(5.0));
    let read = |beside: &str| design_of("unit", &drawing, beside).expect(beside);
    let of_5_m = read("layer = \"ball\"");
    let summary = &of_5_m.files[0].summary;
    let said = "layer \"ball\": r 0.000 to 5000.000 mm, x -5000.000 to 5000.000 mm, 2 sides; unit by $INSUNITS, m";
    assert_eq!(summary, said);
    for (unit, metre) in [("mm", 1e-3), ("um", 1e-6), ("cm", 1e-2), ("in", 25.4e-3)] {
        let design = read(&format!("layer = \"ball\", drawing_unit = \"{unit}\""));
        let r_mm = format!("r 0.000 to {:.3} mm", 5e3 * metre);
        let summary = &design.files[0].summary;
        assert!(
            summary.contains(&r_mm) && summary.ends_with("by drawing_unit"),
            "{summary}"
        );
    }
    // The message of a rejected design states the unit too: a wrong unit may make parts overlap, or
    // leave the core empty.
    let plate = "layer = \"ball\" }\n[[plate]]\nname = \"p\"\nmaterial = \"none\"\nshape = { r = [0.0, 1.0], x = [0.0, 1.0]";
    let refused = design_of("unit", &drawing, plate).expect_err("no material");
    assert!(refused.contains(said), "{refused}");
    let beside = "layer = \"ball\", drawing_unit = \"ft\"";
    let refused = design_of("unit", &drawing, beside).expect_err("feet");
    let said = "body \"b\".shape.drawing_unit: is \"ft\"; allowed: \"m\", \"cm\", \"mm\"";
    assert!(refused.contains(said), "{refused}");
}

/// An outline as other programs write it. Columns: the layer as named and as written; encoding of
/// characters and lines; version, code page and unit; entities, with a comma between groups and `@`
/// for the layer; the result: its area with the source of its unit, or the group and words of the
/// rejection.
const OF_OTHER_PROGRAMS: &str = r#"
AutoCAD R12                   | ball      |                | utf-8 crlf         | AC1009           | HEAVY    | slot by length_unit
AutoCAD R14                   | Körper    |                | ansi crlf handles  | AC1014 ANSI_1252 | LIGHT    | slot by length_unit
AutoCAD 2000, a foreign layer | Ω-Kern€   | \U+03A9-Kern\U+20AC | utf-8 crlf handles | AC1015 ANSI_1252 4 | LIGHT | slot by $INSUNITS, mm
AutoCAD 2018, hidden, paper   | Ω         |                | utf-8 crlf handles | AC1032 4         | LIGHT,0 LINE,8 @,60 1,10 0,0 LINE,67 1,8 @,10 0 | slot by $INSUNITS, mm
AutoCAD, exploded to a point  | ball      |                | utf-8 crlf         | AC1032 4         | SLOT,0 LINE,8 @,10 13,20 2,11 13,21 2 | slot by $INSUNITS, mm
LibreCAD                      | ball      |                | utf-8 lf handles   | AC1021 ANSI_1252 4 | SLOT   | slot by $INSUNITS, mm
QCAD, closing vertex twice    | ball      |                | utf-8 lf handles   | AC1015 0         | LIGHT,10 9,20 2 | slot by length_unit
FreeCAD, a vertex twice       | ball      |                | utf-8 lf           | AC1014           | 0 LWPOLYLINE,8 @,70 1,10 9,20 2,10 13,20 2,10 13,20 2,10 13,20 4,10 9,20 4 | rectangle by length_unit
Maker.js                      | ball      |                | utf-8 lf           | AC1009 4         | HEAVY    | slot by $INSUNITS, mm
KiCad                         | Edge.Cuts |                | utf-8 lf handles   | AC1018 4         | SLOT     | slot by $INSUNITS, mm
Onshape, inches               | 0         |                | utf-8 crlf         | AC1015 1         | INCHES   | slot by $INSUNITS, in
Inkscape R14, straight sides  | weiß_1    |                | ansi lf handles    | AC1014           | 0 LWPOLYLINE,8 @,90 4,70 1,10 9,20 2,30 0.0,10 13,20 2,30 0.0,10 13,20 4,30 0.0,10 9,20 4,30 0.0 | rectangle by length_unit
OpenSCAD                      | 0         |                | utf-8 lf           | AC1006           | 0 LWPOLYLINE,100 AcDbEntity,8 0,90 4,70 1,10 9,20 2,10 13,20 2,10 13,20 4,10 9,20 4 | rectangle by length_unit
CloudCompare, closed by hand  | ball      |                | utf-8 lf           | AC1009           | 0 POLYLINE,8 @,66 1,70 8,10 0.0,20 0.0,0 VERTEX,8 @,10 9,20 2,0 VERTEX,8 @,10 13,20 2,0 VERTEX,8 @,10 13,20 4,0 VERTEX,8 @,10 9,20 4,0 VERTEX,8 @,10 9,20 2,0 SEQEND | rectangle by length_unit
Rhino                         | Default   |                | utf-8 crlf handles | AC1018 UNDEFINED 4 | HEAVY  | slot by $INSUNITS, mm
a Macintosh, lines end in CR  | ball      |                | utf-8 cr           | AC1009           | HEAVY    | slot by length_unit
a mail, with text behind EOF  | ball      |                | utf-8 crlf mail    | AC1015 4         | LIGHT    | slot by $INSUNITS, mm
Inkscape R14, curves          | ball      |                | ansi lf            | AC1014           | 0 SPLINE,8 @,70 8 | 0 SPLINE: draw splines and ellipses as arcs
LibreCAD, an ellipse          | ball      |                | utf-8 lf           | AC1021 4         | 0 ELLIPSE,8 @ | 0 ELLIPSE: draw splines and ellipses as arcs
BricsCAD, a block             | ball      |                | utf-8 crlf         | AC1032 4         | 0 INSERT,8 @,2 core | 0 INSERT: explode blocks
DraftSight, a hatch           | ball      |                | utf-8 crlf         | AC1027 4         | LIGHT,0 HATCH,8 @ | 0 HATCH: move the rest to another layer
SolidWorks, mirrored          | ball      |                | utf-8 crlf         | AC1024 4         | 0 ARC,8 @,10 -13,20 3,40 1,210 0,220 0,230 -1,50 90,51 270 | 0 ARC: flatten the drawing, or mirror and explode it
AutoCAD R12, a fitted curve   | ball      |                | utf-8 crlf         | AC1009           | 0 POLYLINE,8 @,66 1,70 4,0 VERTEX,8 @,10 9,20 2,0 SEQEND | 0 POLYLINE: draw splines and ellipses as arcs
CadQuery, mm called metres    | ball      |                | utf-8 lf           | AC1015 6         | 0 CIRCLE,8 @,10 12,20 3,40 1 | 0 CIRCLE: the unit is by $INSUNITS, m: another by drawing_unit
nanoCAD, Cyrillic before 2007 | Сердечник |                | cyrillic crlf      | AC1018 ANSI_1251 4 | LIGHT  | 1: names in ANSI_1251 are read as UTF-8 or ANSI_1252: save as DXF 2007 or later
AutoCAD R12, capitals         | ball      | BALL           | utf-8 crlf         | AC1009           | HEAVY    | 1: a layer that is drawn on: BALL
AutoCAD, a side drawn twice   | ball      |                | utf-8 crlf         | AC1032 4         | SLOT,0 LINE,8 @,10 13,20 4,11 9,21 4 | 0 LINE: without a side drawn twice
a download that broke off     | ball      |                | utf-8 lf cut       | AC1015 4         | SLOT     | 51 270: a whole drawing: save it again
"#;

/// The entities of a drawing as groups, from a cell of the table.
fn entities(cell: &str, layer: &str, handles: bool) -> String {
    let [slot, light] = slot().map(|sides| sides.concat());
    let inches = slot.lines().map(|line| match line.split_once(' ') {
        Some((code @ ("10" | "11" | "20" | "21" | "40"), mm)) => {
            format!("{code} {:.10}\n", mm.parse::<f64>().unwrap() / 25.4)
        }
        _ => format!("{line}\n"),
    });
    let vertex = |[r, x, bulge]: [u32; 3]| format!("0 VERTEX\n8 @\n10 {r}\n20 {x}\n42 {bulge}\n");
    let vertices = [[9, 2, 0], [13, 2, 1], [13, 4, 0], [9, 4, 1]].map(vertex);
    let heavy = format!(
        "0 POLYLINE\n8 @\n66 1\n70 1\n10 0.0\n20 0.0\n{}0 SEQEND\n8 @\n",
        vertices.concat()
    );
    let inches = inches.collect::<String>();
    let named = [
        ("SLOT", slot),
        ("LIGHT", light),
        ("HEAVY", heavy),
        ("INCHES", inches),
    ];
    let groups = named.iter().fold(
        cell.replace(',', "\n") + "\n",
        |groups, (name, entities)| groups.replace(name, entities.trim()),
    );
    let groups = groups
        .replace("8 ball", "8 @")
        .replace("8 @", &format!("8 {layer}"));
    if !handles {
        return groups;
    }
    let start = |line: &str| match line.starts_with("0 ") {
        true => format!("{line}\n5 2F\n330 1F\n100 AcDbEntity\n"),
        false => format!("{line}\n"),
    };
    groups.lines().map(start).collect()
}

#[test]
fn drawings_of_other_programs() {
    let written = OF_OTHER_PROGRAMS.trim().lines();
    assert_eq!(written.clone().count(), 28);
    for row in written {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [program, layer, escaped, bytes, header, drawn, expected] = cells[..] else {
            panic!("{row}");
        };
        let drawn = entities(
            drawn,
            if escaped.is_empty() { layer } else { escaped },
            bytes.contains("handles"),
        );
        let header = header.split(' ').map(|word| match word {
            version if version.starts_with("AC1") => format!("9 $ACADVER\n1 {version}\n"),
            page if page.contains(char::is_alphabetic) => format!("9 $DWGCODEPAGE\n3 {page}\n"),
            unit => format!("9 $INSUNITS\n70 {unit}\n"),
        });
        let header: String = header.collect();
        let groups = format!(
            "999 written by {program}\n0 SECTION\n2 HEADER\n{header}0 ENDSEC\n0 SECTION\n2 ENTITIES\n{drawn}"
        );
        let ends = ["-- \nsent from a phone\n", ""].map(|more| format!("0 ENDSEC\n0 EOF\n{more}"));
        let end = match bytes {
            bytes if bytes.contains("cut") => "",
            bytes if bytes.contains("mail") => &ends[0],
            _ => &ends[1],
        };
        let newline = match bytes {
            bytes if bytes.contains("crlf") => "\r\n",
            bytes if bytes.contains("cr") => "\r",
            _ => "\n",
        };
        let file = ended(&(groups.clone() + end), newline);
        let byte = |c: char| match c {
            'А'..='я' => u8::try_from(c as u32 - 'А' as u32 + 0xC0).unwrap(),
            _ => u8::try_from(c).unwrap(),
        };
        let file = match bytes.starts_with("utf-8") {
            true => file.into_bytes(),
            false => file.chars().map(byte).collect(),
        };
        let design = design_of("programs", file, &format!("layer = \"{layer}\""));
        let read = ["slot", "rectangle"].iter().find_map(|shape| {
            let unit = expected.strip_prefix(shape)?.strip_prefix(" by ")?;
            Some((*shape, unit))
        });
        if let Some((shape, unit)) = read {
            let design = design.expect(program);
            let found = &design.parts[0].shape;
            match shape {
                "slot" => is_slot(found),
                _ => assert!((1e6 * found.area_m2() - 8.0).abs() < 1e-8, "{program}"),
            }
            let summary = &design.files[0].summary;
            let said = format!("; unit by {unit}");
            assert!(summary.ends_with(&said), "{program}: {summary}");
            continue;
        }
        let (group, words) = expected.split_once(": ").expect("a group");
        // The line of the value of the last group with this code.
        let line = groups.lines().collect::<Vec<_>>();
        let line = line.iter().rposition(|line| *line == group);
        let line = line.map_or(1, |index| 2 * index + 2);
        let refused = design.map(|_| ()).expect_err(program);
        assert!(
            refused.contains(&format!("core.dxf:{line}: ")),
            "{program}, {line}: {refused}"
        );
        assert!(refused.contains(words), "{program}: {refused}");
    }
}
