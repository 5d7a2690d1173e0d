//! Place, force and radius of presses on a world in closed form, which shares no function with the
//! estimator.

use std::array::from_fn;
use std::sync::LazyLock;

use palpate_model::touch::{
    Array, ArrayError, BASE, BENT, BY_RADIUS, Coefficients, Coil, CommonError, Indenter, Press,
    Profile, ReadingError, Region, Track, Verdict,
};
use palpate_model::units::{Metre, Newton};
use proptest::prelude::*;

use crate::common::linalg::least_squares;
use crate::common::rng::Rng;
use crate::common::touch_world::{Pressure, World, seven, square, three_around_one};

const SPACING_M: f64 = 2e-3;
const RADII_M: [f64; 2] = [1e-3, 5e-3];
const NOISE: f64 = 1e-5;
/// Differences of the fitted profile from the world, and drawn errors of the gains.
const ERRORS: ReadingError = ReadingError {
    relative: 5e-3,
    of_largest: 4e-3,
};

/// The B-spline of an order, centred at zero, by De Boor's recursion ("A practical guide to
/// splines", chapter IX).
fn spline(order: u32, x: f64) -> f64 {
    if order == 1 {
        return f64::from(u8::from((-0.5..0.5).contains(&x)));
    }
    let half_width = 0.5 * f64::from(order);
    let below = (half_width + x) * spline(order - 1, x + 0.5);
    let above = (half_width - x) * spline(order - 1, x - 0.5);
    (below + above) / f64::from(order - 1)
}

/// Factors of the 19 coefficients at a distance and a radius.
fn factors(distance_m: f64, radius_m: f64) -> Vec<f64> {
    let [least, greatest] = RADII_M.map(f64::sqrt);
    let s = (radius_m.sqrt() - 0.5 * (greatest + least)) / (0.5 * (greatest - least));
    let part = |j: usize| {
        let [x, j] = [distance_m / SPACING_M, j as f64];
        let mirrored = if j > 0.0 { spline(4, x + j) } else { 0.0 };
        spline(4, x - j) + mirrored
    };
    let base = (0..BASE).map(part);
    let linear = (0..BY_RADIUS).map(|j| s * part(j));
    let quadratic = (0..BY_RADIUS).map(|j| s * s * part(j));
    base.chain(linear).chain(quadratic).collect()
}

fn coefficients_of(numbers: &[f64]) -> Coefficients {
    let table = |range: std::ops::Range<usize>| numbers[range].iter().map(|c| *c as f32);
    let short = |from: usize| {
        let of: Vec<f32> = table(from..from + BY_RADIUS).collect();
        of.try_into().unwrap()
    };
    Coefficients {
        spacing: Metre(SPACING_M as f32),
        least_radius: Metre(RADII_M[0] as f32),
        greatest_radius: Metre(RADII_M[1] as f32),
        base: table(0..BASE).collect::<Vec<_>>().try_into().unwrap(),
        linear: short(BASE),
        quadratic: short(BASE + BY_RADIUS),
        bent: [[0.0; BENT]; 3],
        greatest_force: Newton(10.0),
    }
}

/// Distances from 0 to 14 mm and radii from 1 to 5 mm.
fn lattice() -> Vec<[f64; 2]> {
    let radii = (0..=8).map(|a| 1e-3 + 0.5e-3 * f64::from(a));
    radii
        .flat_map(|radius_m| (0..=56).map(move |r| [0.25e-3 * f64::from(r), radius_m]))
        .collect()
}

/// The profile that fits a world best.
fn profile(world: &World) -> Profile {
    let rows: Vec<_> = lattice().iter().map(|&[r, a]| factors(r, a)).collect();
    let right: Vec<_> = lattice()
        .iter()
        .map(|&[r, a]| world.profile(r, a))
        .collect();
    Profile::new(coefficients_of(&least_squares(&rows, &right).0)).unwrap()
}

fn disc(radius_m: f64) -> Region {
    Region::Disc {
        centre: [Metre(0.0); 2],
        radius: Metre(radius_m as f32),
    }
}

/// A world with its array.
struct Sensor {
    world: World,
    array: Array,
    reach_m: f64,
}

impl Sensor {
    fn new(coils: &[[f64; 2]], region: Region, reach_m: f64) -> Self {
        let world = World::new(5e-3, coils);
        let array = array(coils, profile(&world), region).unwrap();
        Self {
            world,
            array,
            reach_m,
        }
    }

    fn scan(&self, presses: &[[f64; 4]]) -> Vec<f32> {
        let readings = self.world.readings(presses);
        readings.iter().map(|reading| *reading as f32).collect()
    }

    /// Presses all over the disc, with three radii.
    fn presses(&self) -> Vec<[f64; 4]> {
        let mut all = Vec::new();
        for ring in 0..=4 {
            for spoke in 0..=5 * ring {
                let angle =
                    0.1 + std::f64::consts::TAU * f64::from(spoke) / f64::from(5 * ring + 1);
                let r = 0.245 * f64::from(ring) * self.reach_m;
                for radius_m in [1.3e-3, 2.2e-3, 4.0e-3] {
                    all.push([r * angle.cos(), r * angle.sin(), 0.8, radius_m]);
                }
            }
        }
        all
    }
}

fn array(coils: &[[f64; 2]], profile: Profile, region: Region) -> Result<Array, ArrayError> {
    let coil = |at: &[f64; 2]| Coil {
        x: Metre(at[0] as f32),
        y: Metre(at[1] as f32),
        gain: 1.0,
        noise: NOISE as f32,
    };
    let coils: Vec<Coil> = coils.iter().map(coil).collect();
    Array::new(&coils, profile, (ERRORS, CommonError::default()), region)
}

static THREE: LazyLock<Sensor> =
    LazyLock::new(|| Sensor::new(&three_around_one(), disc(4e-3), 4e-3));
static SEVEN: LazyLock<Sensor> = LazyLock::new(|| Sensor::new(&seven(), disc(6e-3), 6e-3));
static SQUARE: LazyLock<Sensor> = LazyLock::new(|| {
    let margin = Metre(0.0);
    Sensor::new(&square(), Region::Hull { margin }, 5e-3)
});

fn pin(radius_m: f64) -> Indenter {
    Indenter::Declared {
        at_one_newton: Metre(radius_m as f32),
        exponent: 0.0,
        uncertainty: 0.05,
    }
}

/// Errors of x and y (m), ln F and ln a.
fn errors(press: &Press, truth: &[f64; 4]) -> [f64; 4] {
    let [x, y, force, radius] = truth;
    [
        f64::from(press.x.0) - x,
        f64::from(press.y.0) - y,
        (f64::from(press.force.0) / force).ln(),
        (f64::from(press.radius.0) / radius).ln(),
    ]
}

/// The profile's form against the world, and its splines against De Boor's.
#[test]
fn the_profile_fits_a_layer() {
    for thickness_m in [3e-3, 5e-3] {
        let world = World::new(thickness_m, &[]);
        let profile = profile(&world);
        let peak = world.profile(0.0, 2.2e-3);
        let (mut sum, mut worst) = (0.0, 0.0_f64);
        for [r, a] in lattice() {
            let found = f64::from(profile.reading(1.0, Metre(r as f32), Metre(a as f32)));
            let off = (found - world.profile(r, a)) / peak;
            sum += off * off;
            worst = worst.max(off.abs());
        }
        let rms = (sum / lattice().len() as f64).sqrt();
        println!("layer of {thickness_m} m: rms {rms:.4}, worst {worst:.4} of the peak");
        assert!((1e-3..6e-3).contains(&rms) && worst < 0.03);
    }
    let numbers: Vec<f64> = (0..BASE + 2 * BY_RADIUS)
        .map(|i| (1.7 * i as f64).sin())
        .collect();
    let profile = Profile::new(coefficients_of(&numbers)).unwrap();
    for r in 0..120 {
        for radius_m in [1e-3, 1.7e-3, 5e-3] {
            let distance_m = 0.21e-3 * f64::from(r);
            let parts = factors(distance_m, radius_m);
            let exact: f64 = parts.iter().zip(&numbers).map(|(a, b)| a * b).sum();
            let at = [distance_m, radius_m].map(|of| Metre(of as f32));
            let found = f64::from(profile.reading(1.0, at[0], at[1]));
            assert!(
                (found - exact).abs() < 3e-6,
                "{distance_m}: {found} {exact}"
            );
        }
    }
}

#[test]
fn presses_all_over_the_disc_are_found() {
    for (sensor, place_m, ln_force) in [(&*THREE, 0.25e-3, 0.05), (&*SEVEN, 0.2e-3, 0.05)] {
        let mut evaluations: u32 = 0;
        let presses = sensor.presses();
        for press in &presses {
            let scan = sensor.scan(&[*press]);
            let declared = sensor.world.coils.len() < 7;
            let indenter = if declared {
                pin(press[3])
            } else {
                Indenter::Unknown
            };
            let cold = sensor.array.estimate(&scan, &indenter, None);
            let found = cold
                .claimed()
                .unwrap_or_else(|| panic!("{press:?} {cold:?}"));
            let [x, y, force, _] = errors(found, press);
            assert!(
                x.hypot(y) < place_m && force.abs() < ln_force,
                "{press:?} {cold:?}"
            );
            evaluations = evaluations.max(u32::from(found.evaluations));
            // From another previous press the fit ends at the same press.
            let before = Press {
                x: Metre(-found.x.0 - 1e-3),
                force: Newton(6.0),
                radius: Metre(4.9e-3),
                ..*found
            };
            let warm = sensor.array.estimate(&scan, &indenter, Some(&before));
            let again = warm
                .claimed()
                .unwrap_or_else(|| panic!("{press:?} {warm:?}"));
            // Both end within 0.03 standard errors of the best.
            let [x, y, force, _] = from_fn(|i| 0.1 * found.covariance[i][i].sqrt());
            assert!((again.x - found.x).0.abs() < x, "{cold:?} {warm:?}");
            assert!((again.y - found.y).0.abs() < y, "{cold:?} {warm:?}");
            assert!((again.force / found.force - 1.0).abs() < force);
        }
        println!(
            "{} presses, at most {evaluations} evaluations",
            presses.len()
        );
        assert!(presses.len() > 100 && evaluations <= 16);
    }
}

/// A press slides at 20 mm/s, with 250 noisy scans/s: for each scan the track, with two evaluations,
/// gives the press that a whole fit gives.
#[test]
fn a_track_has_the_answers_of_a_whole_fit() {
    for (sensor, name) in [(&*THREE, "three"), (&*SEVEN, "seven")] {
        let mut rng = Rng::new(3);
        let (mut track, mut worst, mut open, mut scans) = (Track::default(), 0.0_f32, 0, 0);
        for press in 0..20 {
            let indenter = if name == "three" {
                pin(2e-3)
            } else {
                Indenter::Unknown
            };
            for scan in 0..50 {
                // A press that slides faster and faster, at last by 0.2 mm from scan to scan.
                let along = 2e-6 * f64::from(scan * scan) - 3e-3;
                let force_n = 0.2 + 0.05 * f64::from(press);
                let truth = [along, 1e-3, force_n, 2e-3];
                let mut readings = sensor.scan(&[truth]);
                for reading in &mut readings {
                    *reading += (NOISE * rng.normal()) as f32;
                }
                let whole = sensor.array.estimate(&readings, &indenter, None);
                let found = sensor.array.track(&readings, &indenter, &mut track);
                scans += 1;
                let Some((found, whole)) = found.claimed().zip(whole.claimed()) else {
                    open += 1;
                    continue;
                };
                let off = [
                    (found.x - whole.x).0,
                    (found.y - whole.y).0,
                    (found.force / whole.force).ln(),
                    (found.radius / whole.radius).ln(),
                ];
                for (off, row) in off.iter().zip(0..) {
                    worst = worst.max(off.abs() / whole.covariance[row][row].sqrt());
                }
            }
            let nothing = vec![0.0; sensor.world.coils.len()];
            let verdict = sensor.array.track(&nothing, &indenter, &mut track);
            assert_eq!(verdict, Verdict::TooSmall);
        }
        println!("{name}: at most {worst:.3} sigma apart, {open} of {scans} scans without a press");
        assert!(worst < 0.15, "{name}: {worst}");
        assert!(open <= scans / 25, "{name}: {open} of {scans}");
    }
}

/// Share of draws whose errors lie in the 95 % region of all four unknowns, and of the place, force
/// and radius alone; mean evaluations. Readings have noise and errors as declared.
fn coverage(sensor: &Sensor, draws: u32, seed: u64) -> ([f64; 4], f64) {
    let mut rng = Rng::new(seed);
    let (mut covered, mut claimed, mut evaluations) = ([0; 4], 0, 0);
    for _ in 0..draws {
        let r = 0.95 * sensor.reach_m * rng.uniform().sqrt();
        let angle = rng.between(0.0, std::f64::consts::TAU);
        let truth = [
            r * angle.cos(),
            r * angle.sin(),
            rng.between(0.1, 2.0),
            rng.between(1.5e-3, 4.5e-3),
        ];
        // Readings by the estimator's own profile, so that the only errors are those drawn.
        let exact: Vec<f64> = sensor
            .world
            .coils
            .iter()
            .map(|[x, y]| {
                let distance = Metre((truth[0] - x).hypot(truth[1] - y) as f32);
                let profile = sensor.array.profile();
                f64::from(profile.reading(truth[2] as f32, distance, Metre(truth[3] as f32)))
            })
            .collect();
        let largest = exact.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let scan: Vec<f32> = exact
            .iter()
            .map(|y| {
                let own = f64::from(ERRORS.relative) * y * rng.normal();
                let common = f64::from(ERRORS.of_largest) * largest * rng.normal();
                (y + own + common + NOISE * rng.normal()) as f32
            })
            .collect();
        let indenter = pin(truth[3] * (0.05 * rng.normal()).exp());
        let verdict = sensor.array.estimate(&scan, &indenter, None);
        let Some(press) = verdict.claimed() else {
            continue;
        };
        claimed += 1;
        evaluations += u32::from(press.evaluations);
        let error = errors(press, &truth);
        let of = |count: usize, first: usize| {
            let rows: Vec<Vec<f64>> = (0..count)
                .map(|i| {
                    let row = press.covariance[first + i].iter();
                    row.skip(first).take(count).map(|c| f64::from(*c)).collect()
                })
                .collect();
            let right = &error[first..first + count];
            let solved = least_squares(&rows, right).0;
            solved.iter().zip(right).map(|(a, b)| a * b).sum::<f64>()
        };
        // 95 % quantiles of chi-square with 4, 2 and 1 degrees of freedom.
        let squares = [of(4, 0), of(2, 0), of(1, 2), of(1, 3)];
        for (count, (square, limit)) in covered
            .iter_mut()
            .zip(squares.iter().zip([9.488, 5.991, 3.841, 3.841]))
        {
            *count += u32::from(*square < limit);
        }
    }
    assert!(claimed > draws * 9 / 10, "{claimed} of {draws}");
    let share = |count: u32| f64::from(count) / f64::from(claimed);
    (covered.map(share), share(evaluations))
}

#[test]
fn the_covariance_covers_the_truth() {
    for (name, sensor) in [("three", &*THREE), ("seven", &*SEVEN)] {
        let (shares, evaluations) = coverage(sensor, 1_000, 5);
        println!("{name}: all, place, force, radius {shares:.3?}, {evaluations:.1} evaluations");
        // The standard error of a share is 0.7 %.
        for share in shares {
            assert!((0.925..0.975).contains(&share), "{name}: {shares:?}");
        }
    }
}

/// On a mid-line of a square the four coils have only two different readings, so a radius is never
/// claimed there. Beside the mid-line it is claimed.
#[test]
fn a_square_does_not_determine_the_radius_on_its_mid_lines() {
    let (mut on_line, mut covered, mut all, mut beside) = (0, 0, 0, 0);
    for along in [-3e-3, -1.5e-3, 0.0, 2e-3, 3.5e-3] {
        for radius_m in [1.5e-3, 3e-3] {
            let verdict = |[x, y]: [f64; 2]| {
                let scan = SQUARE.scan(&[[x, y, 1.0, radius_m]]);
                SQUARE.array.estimate(&scan, &Indenter::Unknown, None)
            };
            for place in [[along, 0.0], [0.0, along]] {
                let found = verdict(place);
                assert!(!matches!(found, Verdict::Inside(_)), "{place:?}: {found:?}");
                all += 1;
                let Verdict::RadiusNotDetermined(press) = found else {
                    continue;
                };
                on_line += 1;
                // The posterior of ln a is the prior: 0.2887 of ln 5.
                assert!(press.covariance[3][3].sqrt() > 0.9 * 0.2887 * 1.609);
                let [low, high] = press.force_interval();
                covered += u32::from(low.0 < 1.0 && 1.0 < high.0);
            }
            let off_line = verdict([along, 3.3e-3]);
            beside += u32::from(matches!(off_line, Verdict::Inside(_)));
        }
    }
    println!(
        "on the lines {on_line} of {all} not determined, force covered in {covered}; beside them \
         {beside} of 10 determined"
    );
    assert!(on_line >= 14 && covered >= 12 && beside >= 5);
}

#[test]
fn what_is_no_single_press_inside_is_named() {
    let of = |sensor: &Sensor, presses: &[[f64; 4]]| {
        let scan = sensor.scan(presses);
        sensor.array.estimate(&scan, &Indenter::Unknown, None)
    };
    // Two contacts: seven coils detect them, four coils only with a declared indenter.
    let seconds = [[-4e-3, -1e-3], [0.0, -5e-3], [-1e-3, 4e-3], [-5e-3, 2e-3]];
    let refused = |sensor: &Sensor, indenter: &Indenter| {
        let verdict = |second: &[f64; 2]| {
            let two = [[3e-3, 1e-3, 1.0, 2e-3], [second[0], second[1], 0.7, 2e-3]];
            sensor.array.estimate(&sensor.scan(&two), indenter, None)
        };
        let verdicts = seconds.iter().map(verdict);
        let refused = verdicts.filter(|of| matches!(of, Verdict::DoesNotFit { .. }));
        refused.count()
    };
    let by_seven = refused(&SEVEN, &Indenter::Unknown);
    let by_four = [Indenter::Unknown, pin(2e-3)].map(|of| refused(&THREE, &of));
    println!("two contacts do not fit seven coils in {by_seven} of 4, four in {by_four:?}");
    assert!(by_seven >= 3 && by_four[0] <= 2 && by_four[1] >= 3);
    // A gain that has changed by a fifth.
    let mut scan = SEVEN.scan(&[[1e-3, 1e-3, 1.0, 2e-3]]);
    scan[1] *= 1.2;
    let changed = SEVEN.array.estimate(&scan, &Indenter::Unknown, None);
    assert!(matches!(changed, Verdict::DoesNotFit { .. }), "{changed:?}");
    for sensor in [&*THREE, &*SEVEN] {
        let beyond = of(sensor, &[[8e-3, 3e-3, 1.0, 2e-3]]);
        assert!(matches!(beyond, Verdict::BeyondArray(_)), "{beyond:?}");
        assert!(beyond.claimed().is_none());
        // 4 sigma of the noise.
        let weak = 4.0 * NOISE / sensor.world.readings(&[[0.0, 0.0, 1.0, 2e-3]])[0];
        assert_eq!(of(sensor, &[[0.0, 0.0, weak, 2e-3]]), Verdict::TooSmall);
        assert_eq!(of(sensor, &[]), Verdict::TooSmall);
    }
}

/// A pin and its equivalent round contact have the same second moment of pressure.
#[test]
fn a_pin_counts_as_a_round_contact_of_five_thirds_of_its_square() {
    let mut world = World::new(5e-3, &seven());
    world.pressure = Pressure::Pin;
    for radius_m in [1.5e-3, 2.5e-3] {
        let press = [1.5e-3, -1e-3, 1.0, radius_m];
        let scan: Vec<f32> = world.readings(&[press]).iter().map(|y| *y as f32).collect();
        let verdict = SEVEN.array.estimate(&scan, &Indenter::Unknown, None);
        let found = verdict.claimed().unwrap_or_else(|| panic!("{verdict:?}"));
        let expected = (5.0_f64 / 3.0).sqrt() * radius_m;
        let off = f64::from(found.radius.0) / expected - 1.0;
        println!("pin of {radius_m} m: {off}");
        assert!(off.abs() < 0.1, "{found:?}");
        assert!((found.force.0 - 1.0).abs() < 0.03, "{found:?}");
    }
}

/// Readings that grow faster than the force, as the elastomer comes nearer: (exp(bend y) - 1)/bend in the
/// world, of which Psi is the second order, bend/2 Phi^2.
#[test]
fn a_bend_of_the_readings_is_undone() {
    let mut world = World::new(5e-3, &three_around_one());
    world.bend = 5.0;
    let straight = profile(&world);
    let parts = |&[r, a]: &[f64; 2]| -> Vec<f64> {
        let all = factors(r, a);
        let of = |from: usize| all[from..from + BENT].to_vec();
        [of(0), of(BASE), of(BASE + BY_RADIUS)].concat()
    };
    let rows: Vec<_> = lattice().iter().map(parts).collect();
    let square = |&[r, a]: &[f64; 2]| 0.5 * world.bend * world.profile(r, a).powi(2);
    let right: Vec<_> = lattice().iter().map(square).collect();
    let (psi, _) = least_squares(&rows, &right);
    let table: Vec<f32> = psi.iter().map(|of| *of as f32).collect();
    let bent = Profile::new(Coefficients {
        bent: table.as_chunks().0.try_into().unwrap(),
        ..*straight.coefficients()
    });
    let bent = array(&three_around_one(), bent.unwrap(), disc(4e-3)).unwrap();
    let press = [1e-3, -2e-3, 2.0, 2e-3];
    let scan: Vec<f32> = world.readings(&[press]).iter().map(|y| *y as f32).collect();
    let force = |array: &Array| {
        let verdict = array.estimate(&scan, &pin(2e-3), None);
        f64::from(verdict.claimed().unwrap().force.0)
    };
    assert!((force(&bent) - 2.0).abs() < 0.01 * 2.0, "{}", force(&bent));
    let ignored = array(&three_around_one(), straight, disc(4e-3)).unwrap();
    assert!(force(&ignored) > 1.05 * 2.0, "{}", force(&ignored));
}

#[test]
fn common_errors_add_to_the_covariance() {
    let scan = THREE.scan(&[[1e-3, 0.0, 1.0, 2e-3]]);
    let common = CommonError {
        place: Metre(0.1e-3),
        ln_force: 0.02,
        ln_radius: 0.1,
    };
    let coils = THREE.array.coils();
    let with = Array::new(coils, *THREE.array.profile(), (ERRORS, common), disc(4e-3)).unwrap();
    let of = |array: &Array| *array.estimate(&scan, &pin(2e-3), None).claimed().unwrap();
    let (alone, with) = (of(&THREE.array), of(&with));
    for (i, added) in [1e-4, 1e-4, 0.02, 0.1_f32].into_iter().enumerate() {
        let found = with.covariance[i][i] - alone.covariance[i][i];
        assert!((found / (added * added) - 1.0).abs() < 1e-3, "{i}: {found}");
    }
}

#[test]
fn the_ellipse_has_the_axes_of_the_covariance() {
    let found = THREE.scan(&[[1e-3, 0.5e-3, 1.0, 2e-3]]);
    let found = THREE.array.estimate(&found, &pin(2e-3), None);
    let mut press = *found.claimed().unwrap();
    for (major, minor, angle) in [
        (3e-4, 1e-4, 0.5_f64),
        (2e-4, 1e-4, -1.2),
        (2e-4, 1e-6, 1.55),
    ] {
        let (sin, cos) = angle.sin_cos();
        let [a, b]: [f64; 2] = [major * major, minor * minor];
        press.covariance[0][0] = (a * cos * cos + b * sin * sin) as f32;
        press.covariance[1][1] = (a * sin * sin + b * cos * cos) as f32;
        press.covariance[0][1] = ((a - b) * sin * cos) as f32;
        let ellipse = press.ellipse();
        let scale = (-2.0 * 0.05_f64.ln()).sqrt();
        assert!((f64::from(ellipse.major.0) / (scale * major) - 1.0).abs() < 1e-4);
        assert!((f64::from(ellipse.minor.0) - scale * minor).abs() < 1e-3 * major);
        assert!(
            (f64::from(ellipse.angle_rad) - angle).abs() < 1e-3,
            "{ellipse:?}"
        );
    }
}

#[test]
fn a_hull_has_the_sides_of_its_outermost_coils() {
    let rows: Vec<[f64; 2]> = (0..8)
        .map(|i| {
            [
                1e-2 * f64::from(i % 4) - 15e-3,
                1e-2 * f64::from(i / 4) - 5e-3,
            ]
        })
        .collect();
    let margin = Metre(-1e-3);
    let sensor = Sensor::new(&rows, Region::Hull { margin }, 5e-3);
    for (place, inside) in [
        ([13.5e-3, 3.4e-3], true),
        ([-13.5e-3, -3.4e-3], true),
        ([2e-3, 4.6e-3], false),
        ([14.6e-3, 0.0], false),
        ([-14.6e-3, 1e-3], false),
    ] {
        let scan = sensor.scan(&[[place[0], place[1], 1.0, 2e-3]]);
        let verdict = sensor.array.estimate(&scan, &pin(2e-3), None);
        // The outermost coils are farther away than the profile reaches, and may contradict.
        let beyond = matches!(verdict, Verdict::BeyondArray(_));
        assert_eq!(beyond, !inside, "{place:?} {verdict:?}");
    }
}

#[test]
fn impossible_arrays_are_refused() {
    let profile = *THREE.array.profile();
    let refused = |coils: &[[f64; 2]], region| array(coils, profile, region).unwrap_err();
    assert_eq!(refused(&[], disc(1e-3)), ArrayError::Coils { given: 0 });
    assert_eq!(
        refused(&[[0.0; 2]; 9], disc(1e-3)),
        ArrayError::Coils { given: 9 }
    );
    let nan = refused(&[[0.0; 2], [0.0, f64::NAN]], disc(1e-3));
    assert!(matches!(nan, ArrayError::Coil { index: 1, .. }), "{nan}");
    let negative = refused(&[[0.0; 2]], disc(-1e-3));
    assert!(matches!(negative, ArrayError::Number(_)), "{negative}");
    for broken in [
        Coefficients {
            greatest_force: Newton(f32::NAN),
            ..*profile.coefficients()
        },
        Coefficients {
            spacing: Metre(0.0),
            ..*profile.coefficients()
        },
        Coefficients {
            greatest_radius: Metre(1e-3),
            ..*profile.coefficients()
        },
    ] {
        assert!(Profile::new(broken).is_err());
    }
}

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        8 => -0.1_f32..0.1,
        2 => any::<f32>(),
        1 => Just(0.0),
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any readings, any indenter and any earlier press get a verdict. A claimed press is finite
    /// and within reach.
    #[test]
    fn any_readings_get_a_verdict(
        readings in prop::collection::vec(number(), 0..9),
        at_one_newton in prop_oneof![Just(2e-3_f32), any::<f32>()],
        exponent in prop_oneof![Just(0.333_f32), any::<f32>()],
        uncertainty in prop_oneof![Just(0.05_f32), any::<f32>()],
        is_declared in any::<bool>(),
        before in prop::option::of([number(), number(), number(), number()]),
    ) {
        let indenter = if is_declared {
            Indenter::Declared { at_one_newton: Metre(at_one_newton), exponent, uncertainty }
        } else {
            Indenter::Unknown
        };
        let before = before.map(|[x, y, force, radius]| Press {
            x: Metre(x),
            y: Metre(y),
            force: Newton(force),
            radius: Metre(radius),
            covariance: [[0.0; 4]; 4],
            chi_square: 0.0,
            informative: 0,
            evaluations: 0,
        });
        for sensor in [&*THREE, &*SEVEN] {
            let verdict = sensor.array.estimate(&readings, &indenter, before.as_ref());
            let readable = readings.len() == sensor.world.coils.len()
                && readings.iter().all(|reading| reading.is_finite());
            if !readable {
                prop_assert_eq!(verdict, Verdict::NotReadable);
            }
            if let Some(press) = verdict.claimed() {
                let numbers = [press.x.0, press.y.0, press.force.0, press.radius.0];
                prop_assert!(numbers.iter().all(|of| of.is_finite()), "{:?}", press);
                prop_assert!(f64::from(press.x.0.hypot(press.y.0)) < 1.001 * sensor.reach_m);
                prop_assert!((0..4).all(|i| press.covariance[i][i] >= 0.0), "{:?}", press);
                prop_assert!(press.ellipse().major >= press.ellipse().minor);
                let [low, high] = press.force_interval();
                prop_assert!(low <= press.force && press.force <= high);
            }
        }
    }

    /// The coils of the ring are equal: a press turned by 60 degrees gives the same force, and a
    /// place turned by 60 degrees.
    #[test]
    fn a_turned_press_is_found_turned(
        r in 0.0_f64..5.5e-3,
        angle in 0.0_f64..std::f64::consts::TAU,
        force_n in 0.1_f64..2.0,
        radius_m in 1.2e-3_f64..4.5e-3,
    ) {
        let of = |angle: f64| {
            let scan = SEVEN.scan(&[[r * angle.cos(), r * angle.sin(), force_n, radius_m]]);
            SEVEN.array.estimate(&scan, &pin(radius_m), None)
        };
        let turn = std::f64::consts::FRAC_PI_3;
        let (first, second) = (of(angle), of(angle + turn));
        prop_assume!(first.claimed().is_some());
        let (first, second) = (*first.claimed().unwrap(), second);
        prop_assert!(second.claimed().is_some(), "{:?}", second);
        let second = *second.claimed().unwrap();
        let (sin, cos) = turn.sin_cos();
        let [x, y] = [f64::from(first.x.0), f64::from(first.y.0)];
        let turned: [f64; 2] = from_fn(|i| [x * cos - y * sin, x * sin + y * cos][i]);
        prop_assert!((turned[0] - f64::from(second.x.0)).abs() < 10e-6);
        prop_assert!((turned[1] - f64::from(second.y.0)).abs() < 10e-6);
        prop_assert!((first.force.0 / second.force.0 - 1.0).abs() < 2e-3);
    }
}
