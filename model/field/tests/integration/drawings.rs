//! Outlines from DXF drawings.

use std::fs;
use std::path::PathBuf;

use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;
use palpate_field::solve::{Accuracy, Excitation, solve};
use proptest::prelude::*;

/// A ball of mu_r 3.7 in a field of 1 mT, drawn on the layer `ball` of a file in a folder of its own.
fn design(folder: &str, drawing: &str) -> Result<Design, String> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("core.dxf"), drawing).expect("a drawing");
    let text = "name = \"x\"\nlength_unit = \"mm\"\n[background]\nfield_T = 1e-3\n[core]\nr = 5.0\nx = [-5.0, 5.0]\n\
                [material.m]\nmu_r = 3.7\n[[body]]\nname = \"b\"\nmaterial = \"m\"\n\
                shape = { outline_dxf = \"core.dxf\", layer = \"ball\" }\n";
    let file = folder.join("ball.toml").display().to_string();
    Design::parse(&file, text).map_err(|error| error.to_string())
}

/// A drawing as programs write it: header, tables, entities; a group a line here, its code and its value.
fn drawing(unit: &str, entities: &str) -> String {
    let groups = format!(
        "0 SECTION\n2 HEADER\n9 $ACADVER\n1 AC1015\n9 $INSUNITS\n70 {unit}\n0 ENDSEC\n\
         0 SECTION\n2 TABLES\n0 TABLE\n2 LAYER\n0 LAYER\n2 ball\n70 0\n0 ENDTAB\n0 ENDSEC\n\
         0 SECTION\n2 ENTITIES\n{entities}0 ENDSEC\n0 EOF\n"
    );
    let group = |group: &str| {
        let (code, value) = group.split_once(' ').unwrap_or((group, ""));
        format!("{code:>3}\r\n{value}\r\n")
    };
    groups.lines().map(group).collect()
}

/// A half-circle of 10 mm about the origin, in some unit.
fn half_circle(radius: f64) -> String {
    format!(
        "0 TEXT\n8 notes\n1 the ball\n0 ARC\n5 1F\n100 AcDbEntity\n8 ball\n100 AcDbCircle\n10 0.0\n20 0.0\n30 0.0\n\
         40 {radius}\n100 AcDbArc\n50 270.0\n51 90.0\n"
    )
}

/// Open along the axis, in millimetres, metres, inches, and in the design's unit.
#[test]
fn a_drawn_ball_is_a_sphere() {
    for (unit, radius) in [("4", 10.0), ("6", 0.01), ("1", 10.0 / 25.4), ("0", 10.0)] {
        let text = drawing(unit, &half_circle(radius));
        let design = design(&format!("ball-{unit}"), &text).expect("a design");
        let accuracy = Accuracy {
            relative: 1e-5,
            ..Accuracy::default()
        };
        let solved = solve(&design, &Excitation::saturating(&design, 1.0), &accuracy);
        let miss = solved.expect("a field").figures.core_mean_t / (11.1e-3 / 5.7) - 1.0;
        println!("a drawn ball, unit {unit}: off by {miss:.1e}");
        assert!(miss.abs() < 1e-5, "{unit}: {miss:e}");
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
    // A circle, and what lies in paper space or on another layer.
    let more = "0 LINE\n8 ball\n67 1\n10 0\n20 0\n11 9\n21 9\n0 SPLINE\n8 notes\n0 CIRCLE\n8 ball\n10 20\n20 0\n40 2\n";
    let circle = shape("circle", more);
    assert!((circle.area_m2() / (4e-6 * std::f64::consts::PI) - 1.0).abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 50, failure_persistence: None, ..ProptestConfig::default() })]

    /// Sides are found in any order, and drawn from either end.
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

#[test]
fn drawings_that_make_no_outline_are_refused() {
    let [parts, _] = slot();
    let all = parts.concat();
    let line = "0 LINE\n8 ball\n10 9\n20 2\n11 9\n21 4\n";
    // Before the first entity stand 18 groups: its name is on line 38.
    for (entities, line, problem) in [
        (
            "0 SPLINE\n8 ball\n".to_owned(),
            38,
            "\"SPLINE\" on this layer is not understood",
        ),
        (
            "0 POLYLINE\n8 ball\n".to_owned(),
            38,
            "\"POLYLINE\" on this layer is not understood",
        ),
        (
            "0 LINE\n8 other\n".to_owned(),
            1,
            "there is nothing on the layer \"ball\"; allowed: a layer that is drawn on: other",
        ),
        (
            parts[..3].concat(),
            64,
            "the outline is open, near r = 9.0000 mm, x = 2.0000 mm and near r = 9.0000 mm, x = 4.0000 mm",
        ),
        (
            format!("{all}{line}"),
            90,
            "three sides meet near r = 9.0000 mm",
        ),
        (
            format!("{all}0 CIRCLE\n8 ball\n10 20\n20 0\n40 2\n"),
            90,
            "belongs to no outline with the rest",
        ),
        (
            "0 LINE\n8 ball\n10 x\n20 2\n11 9\n21 4\n".to_owned(),
            42,
            "\"x\" of LINE is no number",
        ),
        (
            "0 LINE\n8 ball\n10 1e5\n20 2\n11 9\n21 4\n".to_owned(),
            38,
            "100 m is out of range",
        ),
        (
            "0 LINE\n8 ball\n10 1\n20 2\n11 9\n".to_owned(),
            38,
            "LINE without group 21",
        ),
        (
            "0 ARC\n8 ball\n10 5\n20 2\n40 1\n50 10\n51 10\n".to_owned(),
            38,
            "ARC without length",
        ),
        (
            "0 ARC\n8 ball\n10 5\n20 2\n40 1\n50 10\n51 10\n230 -1\n".to_owned(),
            38,
            "ARC is drawn from below",
        ),
        (
            "0 CIRCLE\n8 ball\n10 0\n20 2\n40 1\n".to_owned(),
            38,
            "lies below the axis, near r = -1.0000 mm",
        ),
        (
            "0 LINE\n8 ball\n10 -1\n20 2\n11 9\n21 4\n".to_owned(),
            38,
            "lies below the axis",
        ),
        (
            "0 LINE\n8 ball\n10 1\n20 2\n11 9\nB 4\n".to_owned(),
            47,
            "\"B\" is no group code",
        ),
    ] {
        let refused = design("refused", &drawing("4", &entities)).expect_err(problem);
        assert!(refused.contains(problem), "{problem}: {refused}");
        assert!(
            refused.contains(&format!("core.dxf:{line}: ")),
            "{line}: {refused}"
        );
    }
    let refused = design("refused", &drawing("3", &all)).expect_err("miles");
    assert!(
        refused.contains("core.dxf:12: $INSUNITS is \"3\"; allowed: 0"),
        "{refused}"
    );
    let refused = design("refused", "AutoCAD Binary DXF\r\n\u{1a}\0").expect_err("binary");
    assert!(
        refused.contains("core.dxf:1: is a binary DXF file"),
        "{refused}"
    );
}
