//! Outlines with arcs.

use std::f64::consts::PI;

use palpate_field::design::Design;
use palpate_field::geometry::Point;
use palpate_field::geometry::path::Path;
use palpate_field::geometry::shape::Shape;
use palpate_field::solve::{Accuracy, Excitation, Solved, solve};
use proptest::prelude::*;

/// A design with bodies of mu_r 3.7 in a background field of 1 mT.
fn design(core: &str, bodies: &[&str]) -> Result<Design, String> {
    let body = |(index, shape): (usize, &&str)| {
        format!("[[body]]\nname = \"{index}\"\nmaterial = \"m\"\n{shape}\n")
    };
    let bodies: String = bodies.iter().enumerate().map(body).collect();
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[background]\nfield_T = 1e-3\n[core]\n{core}\n\
         [material.m]\nmu_r = 3.7\n{bodies}"
    );
    Design::parse("x", &text).map_err(|error| error.to_string())
}

const CORE: &str = "r = 5.0\nx = [-5.0, 5.0]";
const SPHERE: &str = "shape = { outline = [[0, -10], { through = [10, 0] }, [0, 10]] }";

fn solved(design: &Design) -> Solved {
    let accuracy = Accuracy {
        relative: 1e-5,
        ..Accuracy::default()
    };
    solve(design, &Excitation::saturating(design, 1.0), &accuracy).expect("a field")
}

/// A sphere drawn with arcs has the closed form 3 mu/(mu + 2) B0.
#[test]
fn a_sphere_of_arcs_is_a_sphere() {
    // `SPHERE`, drawn with arcs of other lengths through other points.
    let three = "shape = { outline = [[0, -10], { through = [6, -8] }, [8, -6], { through = [10, 0] }, \
                 [6, 8], { through = [\"10 * 5 / 13\", \"10 * 12 / 13\"] }, [0, 10]] }";
    for shape in [SPHERE, three] {
        let figures = solved(&design(CORE, &[shape]).expect("a design")).figures;
        let miss = figures.core_mean_t / (11.1e-3 / 5.7) - 1.0;
        println!("a sphere of arcs: mean off by {miss:.1e}");
        assert!(miss.abs() < 1e-5, "{miss:e}");
        assert!(figures.cv[0] < 1e-4, "{:e}", figures.cv[0]);
    }
}

/// A shell, and the ball that fills it: their arcs belong to one circle, but are drawn through
/// different points.
#[test]
fn arcs_of_one_circle_fit_each_other() {
    let shell = "shape = { outline = [[0, -10], { through = [10, 0] }, [0, 10], [0, 7], \
                 { through = [7, 0] }, [0, -7]] }";
    let ball =
        "shape = { outline = [[0, -7], { through = [\"7 * 3 / 5\", \"7 * 4 / 5\"] }, [0, 7]] }";
    let both = solved(&design(CORE, &[shell, ball]).expect("a design")).figures;
    let miss = both.core_mean_t / (11.1e-3 / 5.7) - 1.0;
    assert!(miss.abs() < 1e-5, "{miss:e}");
    let overlapping = ball
        .replace("7 * 3 / 5", "7.1 * 3 / 5")
        .replace("7 * 4 / 5", "7.1 * 4 / 5");
    let refused = design(CORE, &[shell, &overlapping]).expect_err("overlap");
    assert!(
        refused.contains("body \"1\": overlaps body \"0\""),
        "{refused}"
    );
}

/// A ring of round wire has the volume 2 pi^2 R a^2; with flats and fillets it has less.
#[test]
fn the_mesh_has_the_volume_of_the_outline() {
    let ring =
        "shape = { outline = [[8, 3], { through = [10, 5] }, [12, 3], { through = [10, 1] }] }";
    // A rectangle of 4 x 6 mm with fillets of 1 mm; corner to centre of the fillet's arc is 1/sqrt 2.
    let fillet = "shape = { outline = [[9, 0], [11, 0], { through = [\"11 + s\", \"1 - s\"] }, [12, 1], \
                  [12, 5], { through = [\"11 + s\", \"5 + s\"] }, [11, 6], [9, 6], \
                  { through = [\"9 - s\", \"5 + s\"] }, [8, 5], [8, 1], { through = [\"9 - s\", \"1 - s\"] }] }"
        .replace('s', &format!("{}", 0.5_f64.sqrt()))
        .replace("0.7071067811865476hape", "shape");
    let fillet = &fillet;
    let round = 2.0 * PI * PI * 10.0 * 4.0;
    let square = 2.0 * PI * 10.0 * (24.0 - (4.0 - PI));
    for (shape, exact_mm3) in [(ring, round), (fillet, square)] {
        let design = design(CORE, &[shape]).expect(shape);
        let solved = solved(&design);
        let mut volume_m3 = 0.0;
        solved.visit(|at| {
            if at.region.part.is_some() {
                volume_m3 += 2.0 * PI * at.weight * at.point[0];
            }
        });
        let miss = 1e9 * volume_m3 / exact_mm3 - 1.0;
        println!("volume: off by {miss:.1e}");
        assert!(miss.abs() < 1e-6, "{miss:e}");
    }
}

/// Invalid outlines, each with words of its error message.
const REFUSED: &str = "
[{ through = [1, 0] }, [0, -1], [0, 1]]                                        | through stands behind no corner
[[0, -1], { through = [1, 0] }, { through = [2, 0] }, [0, 1]]                  | through stands behind no corner
[[0, -1], { through = [0, 0.5] }, [0, 1]]                                      | through lies on the line
[[0, -1], { through = [1e-8, 0] }, [0, 1]]                                     | through lies on the line
[[1, -1], { through = [0.1, 0] }, [1, 1], [0.05, 0]]                           | crosses itself
[[1, 3], { through = [3, 5] }, [5, 3], [5, 6], { through = [3, 4.5] }, [1, 6]] | crosses itself
[[0.2, 3], { through = [0.05, 2.9] }, [0.2, 1], [2, 2]]                        | below the axis
[[1, 3], { through = [2, 2] }]                                                 | through lies on the line
[[1, 3], { over = [2, 2] }, [1, 5]]                                            | unknown field `over`
[[1, 3], { }, [1, 5]]                                                          | missing field `through`
[[1, 3, 4], [1, 5], [2, 5]]                                                    | a corner has two numbers
[[1, 3], 7, [1, 5]]                                                            | a corner [r, x], or { through = [r, x] }
[[1, 3], { through = [-2, 2] }, [1, 5]]                                        | is below the axis
";

#[test]
fn outlines_that_make_no_sense_are_refused() {
    for row in REFUSED.trim().lines() {
        let (outline, problem) = row.split_once(" | ").expect(row);
        let shape = format!("shape = {{ outline = {outline} }}");
        let refused = design(CORE, &[&shape]).expect_err(outline);
        assert!(refused.contains(problem), "{outline}: {refused}");
        assert!(refused.starts_with("x:13: "), "{outline}: {refused}");
    }
}

/// A star of lines and arcs about the origin; each corner is given by its distance and by the bulge
/// of the arc to the next corner.
fn star(corners: &[(f64, f64)]) -> Vec<Path> {
    let count = corners.len();
    let at = |k: usize| {
        let (sine, cosine) = (2.0 * PI * k as f64 / count as f64).sin_cos();
        let size = corners[k % count].0;
        [size * cosine, size * sine]
    };
    let side = |k: usize| {
        let ([a, b], bulge) = ([at(k), at(k + 1)], corners[k].1);
        let middle = [0, 1].map(|axis: usize| 0.5 * (a[axis] + b[axis]));
        let through = [
            middle[0] + bulge * (b[1] - a[1]),
            middle[1] - bulge * (b[0] - a[0]),
        ];
        Path::arc_through(a, through, b).unwrap_or_else(|| vec![Path::line(a, b)])
    };
    (0..count).flat_map(side).collect()
}

/// Whether a polygon winds about a point an odd number of times, from the angles of its sides as
/// seen from the point.
fn winds_about(polygon: &[Point], point: Point) -> bool {
    let angle = |corner: &Point| (corner[1] - point[1]).atan2(corner[0] - point[0]);
    let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let turn = |(a, b): (&Point, &Point)| {
        let turn = angle(b) - angle(a);
        turn - 2.0 * PI * (turn / (2.0 * PI)).round()
    };
    let turns = (sides.map(turn).sum::<f64>() / (2.0 * PI)).round();
    turns.rem_euclid(2.0) == 1.0
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// An outline with arcs has the area and the inside of a polygon with many short sides along
    /// it.
    #[test]
    fn an_outline_is_its_fine_polygon(
        corners in prop::collection::vec((1.0..2.0_f64, -0.2..0.6_f64), 3..9),
        points in prop::collection::vec((-3.0..3.0_f64, -3.0..3.0_f64), 50),
    ) {
        let paths = star(&corners);
        let fine = |path: &Path| (0..400).map(|k| path.at(f64::from(k) / 400.0)).collect::<Vec<_>>();
        let polygon: Vec<Point> = paths.iter().flat_map(fine).collect();
        let shape = Shape::Outline(paths.clone());
        let area = Shape::Polygon(polygon.clone()).area_m2();
        prop_assert!((shape.area_m2() / area - 1.0).abs() < 1e-4, "{area}");
        for (r, x) in points {
            let near = polygon.iter().any(|corner| (corner[0] - r).hypot(corner[1] - x) < 0.02);
            prop_assert!(near || shape.contains([r, x]) == winds_about(&polygon, [r, x]), "{r} {x}");
        }
        let reach = |axis: usize, points: &[Point]| points.iter().map(|point| point[axis]).fold(0.0, f64::max);
        for axis in 0..2 {
            prop_assert!((reach(axis, &shape.extremes()) - reach(axis, &polygon)).abs() < 1e-3);
        }
    }
}
