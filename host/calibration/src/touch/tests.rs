//! Calibration on a world in closed form, and estimates by the instrument's own arithmetic with it.

use palpate_model::touch as instrument;
use palpate_model::units::{Metre, Newton};
use palpate_sim::random::Stream;

use super::*;
use world::{World, seven, three_around_one};

// Shares no function with calibration or estimator.
#[path = "../../../../model/tests/integration/common/touch_world.rs"]
#[allow(dead_code, unreachable_pub)]
mod world;

const NOISE: f64 = 1e-5;

/// A sensor that differs from its design, on a bench with errors.
struct Rig {
    world: World,
    design: Design,
    chance: Stream,
}

impl Rig {
    fn new(nominal_m: &[[f64; 2]], seed: u64) -> Self {
        let mut chance = Stream::named(seed, "touch");
        let mut world = World::new(5e-3, nominal_m);
        for (place, gain) in world.coils.iter_mut().zip(&mut world.gains) {
            *place = place.map(|at| at + 0.15e-3 * chance.normal());
            *gain = 1.0 + 0.03 * chance.normal();
        }
        world.bend = 3.0;
        let design = Design {
            coils_m: nominal_m.to_vec(),
            place_tolerance_m: 0.3e-3,
            gain_tolerance: 0.05,
            noise: NOISE,
            scales: Scales {
                spacing_m: 2e-3,
                radii_m: [1e-3, 5e-3],
            },
            reach_m: if nominal_m.len() < 7 { 4e-3 } else { 6e-3 },
            radius_in_use: if nominal_m.len() < 7 { 0.1 } else { 0.46 },
            bench: Bench {
                place_m: 0.03e-3,
                force: 3e-3,
                radius: 0.02,
                common: CommonError::default(),
            },
        };
        Self {
            world,
            design,
            chance,
        }
    }

    fn readings(&mut self, press: [f64; 4]) -> Vec<f64> {
        let exact = self.world.readings(&[press]);
        let noisy = exact.iter().map(|y| y + NOISE * self.chance.normal());
        noisy.collect()
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.chance.uniform()
    }

    /// A press at a place, with a force and radius drawn, stated with the bench's errors.
    fn press(&mut self, place_m: [f64; 2]) -> KnownPress {
        let (force_n, radius_m) = (self.between(0.3, 2.0), self.between(1.1e-3, 4.8e-3));
        let bench = self.design.bench;
        let [x, y] = place_m.map(|at| at + bench.place_m * self.chance.normal());
        let readings = self.readings([x, y, force_n, radius_m]);
        KnownPress {
            place_m,
            force_n: force_n * (1.0 + bench.force * self.chance.normal()),
            radius_m: radius_m * (bench.radius * self.chance.normal()).exp(),
            readings,
        }
    }

    /// Presses in the holes of a template: a sunflower's lattice, over the coils and 2 mm beyond the
    /// reach.
    fn presses(&mut self, count: u32) -> Vec<KnownPress> {
        let outer_m = self.design.reach_m + 2e-3;
        let hole = |i: u32| {
            let r = outer_m * ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
            let angle = 2.399_963 * f64::from(i);
            [r * angle.cos(), r * angle.sin()]
        };
        (0..count).map(|i| self.press(hole(i))).collect()
    }
}

/// The array as the instrument takes it.
fn array(calibration: &ArrayCalibration, reach_m: f64) -> instrument::Array {
    let table = |of: &[f64]| of.iter().map(|c| *c as f32).collect::<Vec<_>>();
    let [linear, quadratic] = calibration.by_radius();
    let [least, greatest] = calibration.scales().radii_m;
    let bent = table(calibration.bent());
    let profile = instrument::Profile::new(instrument::Coefficients {
        spacing: Metre(calibration.scales().spacing_m as f32),
        least_radius: Metre(least as f32),
        greatest_radius: Metre(greatest as f32),
        base: table(calibration.base()).try_into().unwrap(),
        linear: table(linear).try_into().unwrap(),
        quadratic: table(quadratic).try_into().unwrap(),
        bent: bent.as_chunks().0.try_into().unwrap(),
        greatest_force: Newton(calibration.greatest_force_n() as f32),
    });
    let coil = |coil: &CalibratedCoil| instrument::Coil {
        x: Metre(coil.place_m[0] as f32),
        y: Metre(coil.place_m[1] as f32),
        gain: coil.gain as f32,
        noise: NOISE as f32,
    };
    let coils: Vec<_> = calibration.coils().iter().map(coil).collect();
    let (reading, common) = (calibration.reading_error, calibration.common_error);
    let errors = (
        instrument::ReadingError {
            relative: reading.relative as f32,
            of_largest: reading.of_largest as f32,
        },
        instrument::CommonError {
            place: Metre(common.place_m as f32),
            ln_force: common.ln_force as f32,
            ln_radius: common.ln_radius as f32,
        },
    );
    let region = instrument::Region::Disc {
        centre: [Metre(0.0); 2],
        radius: Metre(reach_m as f32),
    };
    instrument::Array::new(&coils, profile.unwrap(), errors, region).unwrap()
}

/// Error of the place over its 95 % ellipse, error of ln F with its sigma, and error of the place, m.
#[derive(Default)]
struct Judged {
    presses: usize,
    claimed: usize,
    places_m: Vec<f64>,
    place_covered: usize,
    place_square: f64,
    force_square: f64,
    force_covered: usize,
    radius_square: f64,
    radii: usize,
    radius_covered: usize,
    /// Sums of the squared errors of place and ln F, each over its bound.
    over_bound: [f64; 2],
}

impl Judged {
    fn add(
        &mut self,
        rig: &mut Rig,
        (calibration, array): (&ArrayCalibration, &instrument::Array),
        declared: bool,
    ) {
        let r = 0.97 * rig.design.reach_m * rig.chance.uniform().sqrt();
        let angle = rig.between(0.0, std::f64::consts::TAU);
        let (force_n, radius_m) = (rig.between(0.2, 2.0), rig.between(1.3e-3, 4.5e-3));
        let truth = [r * angle.cos(), r * angle.sin(), force_n, radius_m];
        let readings = rig.readings(truth);
        let scan: Vec<f32> = readings.iter().map(|y| *y as f32).collect();
        let indenter = if declared {
            instrument::Indenter::Declared {
                at_one_newton: Metre((radius_m * (0.05 * rig.chance.normal()).exp()) as f32),
                exponent: 0.0,
                uncertainty: 0.05,
            }
        } else {
            instrument::Indenter::Unknown
        };
        self.presses += 1;
        let verdict = array.estimate(&scan, &indenter, None);
        let Some(press) = verdict.claimed() else {
            return;
        };
        self.claimed += 1;
        let [dx, dy] = [
            f64::from(press.x.0) - truth[0],
            f64::from(press.y.0) - truth[1],
        ];
        self.places_m.push(dx.hypot(dy));
        let [[xx, xy, ..], [_, yy, ..], ..] = press.covariance.map(|row| row.map(f64::from));
        let square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy);
        self.place_square += 0.5 * square;
        self.place_covered += usize::from(square < 5.991);
        let off = (f64::from(press.force.0) / force_n).ln();
        self.force_square += off * off;
        let exact = KnownPress {
            place_m: [truth[0], truth[1]],
            force_n,
            radius_m,
            readings,
        };
        let [x, y, force, _] = calibration.bound(&exact).unwrap();
        self.over_bound[0] += (dx * dx + dy * dy) / (x + y);
        self.over_bound[1] += off * off / force;
        let variance = f64::from(press.covariance[2][2]);
        self.force_covered += usize::from(off * off < 3.841 * variance);
        if matches!(verdict, instrument::Verdict::Inside(_)) {
            let off = (f64::from(press.radius.0) / radius_m).ln();
            let variance = f64::from(press.covariance[3][3]);
            self.radii += 1;
            self.radius_square += off * off;
            self.radius_covered += usize::from(off * off < 3.841 * variance);
        }
    }

    fn share(count: usize, of: usize) -> f64 {
        count as f64 / of as f64
    }
}

#[test]
fn presses_are_found_with_the_calibration() {
    for (name, coils, declared) in [
        ("three-around-one, declared", three_around_one(), true),
        ("seven", seven(), false),
    ] {
        let mut judged = Judged::default();
        let (mut place_off, mut gain_off, mut parts) = (0.0, 0.0, 0);
        for seed in 1..=8 {
            let mut rig = Rig::new(&coils, seed);
            let presses = rig.presses(40);
            let calibration = calibrate(&rig.design, &presses).unwrap();
            if seed <= 3 {
                println!(
                    "{:?} {:?} form {:.4}, residuals {:.2}, added {:?}",
                    calibration.reading_error,
                    calibration.common_error,
                    calibration.form,
                    calibration.residual_ratio,
                    calibration.added_errors().unwrap(),
                );
            }
            assert!(
                calibration.suspects.len() <= 1,
                "{:?}",
                calibration.suspects
            );
            let found = calibration
                .coils()
                .into_iter()
                .zip(calibration.coil_errors());
            let mean = rig.world.gains.iter().map(|gain| gain.ln()).sum::<f64>()
                / rig.world.gains.len() as f64;
            for ((coil, sigmas), (place, gain)) in
                found.zip(rig.world.coils.iter().zip(&rig.world.gains))
            {
                for axis in 0..2 {
                    place_off += ((coil.place_m[axis] - place[axis]) / sigmas[axis]).powi(2);
                }
                gain_off += ((coil.gain.ln() - gain.ln() + mean) / sigmas[2]).powi(2);
                parts += 1;
            }
            let array = array(&calibration, rig.design.reach_m);
            for _ in 0..60 {
                judged.add(&mut rig, (&calibration, &array), declared);
            }
        }
        judged.places_m.sort_by(f64::total_cmp);
        let quantile = |share: f64| judged.places_m[(share * judged.claimed as f64) as usize];
        let root = |square: f64, count: usize| (square / count as f64).sqrt();
        println!(
            "{name}: {} of {} claimed, place median {:.3} mm, 95 % {:.3} mm, covered {:.3} (chi-square {:.2}); force \
             {:.4}, covered {:.3}; radius {:.3} of {}, covered {:.3}; coils off by {:.2} and {:.2} sigmas",
            judged.claimed,
            judged.presses,
            1e3 * quantile(0.5),
            1e3 * quantile(0.95),
            Judged::share(judged.place_covered, judged.claimed),
            judged.place_square / judged.claimed as f64,
            root(judged.force_square, judged.claimed),
            Judged::share(judged.force_covered, judged.claimed),
            root(judged.radius_square, judged.radii),
            judged.radii,
            Judged::share(judged.radius_covered, judged.radii),
            root(place_off, 2 * parts),
            root(gain_off, parts),
        );
        let over_bound = judged.over_bound.map(|of| of / judged.claimed as f64);
        println!("squared errors of place and force over their bounds: {over_bound:.2?}");
        assert!(judged.claimed * 100 > 94 * judged.presses);
        // 0.8 of the bound's efficiency. Of this layer the profile leaves out less than its presses show.
        for of in over_bound {
            assert!(of < 1.25, "{of}");
        }
        assert!(quantile(0.5) < 0.1e-3 && quantile(0.95) < 0.4e-3);
        assert!(root(judged.force_square, judged.claimed) < 0.03);
        assert!(root(judged.radius_square, judged.radii) < 0.15);
        for (covered, of) in [
            (judged.place_covered, judged.claimed),
            (judged.force_covered, judged.claimed),
            (judged.radius_covered, judged.radii),
        ] {
            assert!(
                (0.9..=0.995).contains(&Judged::share(covered, of)),
                "{covered} of {of}"
            );
        }
        for off in [root(place_off, 2 * parts), root(gain_off, parts)] {
            assert!((0.6..1.6).contains(&off), "{off}");
        }
    }
}

#[test]
fn bad_presses_are_named_with_their_cause() {
    let mut rig = Rig::new(&three_around_one(), 21);
    let mut presses = rig.presses(40);
    // The wrong hole: what is pressed is press 30's.
    let truth = presses[30].place_m;
    let stated = presses[7].place_m;
    presses[7] = KnownPress {
        place_m: stated,
        ..rig.press(truth)
    };
    // The wrong weight.
    presses[12].force_n *= 2.0;
    // The ball slipped, and its edge touched beside.
    let mut two = rig
        .world
        .readings(&[[-3e-3, 1e-3, 0.5, 2e-3], [4e-3, -2e-3, 0.7, 1.5e-3]]);
    two[0] *= 1.3;
    presses[22].readings = two;
    let calibration = calibrate(&rig.design, &presses).unwrap();
    let named: Vec<usize> = calibration.suspects.iter().map(|of| of.press).collect();
    assert_eq!(named, [7, 12, 22], "{:?}", calibration.suspects);
    let causes: Vec<Cause> = calibration.suspects.iter().map(|of| of.cause).collect();
    let Cause::Place([x, y]) = causes[0] else {
        panic!("{causes:?}");
    };
    assert!(
        (x - truth[0]).hypot(y - truth[1]) < 0.3e-3,
        "{x} {y} {truth:?}"
    );
    let Cause::Force(force_n) = causes[1] else {
        panic!("{causes:?}");
    };
    assert!((2.0 * force_n / presses[12].force_n - 1.0).abs() < 0.05);
    assert_eq!(causes[2], Cause::Unknown, "{causes:?}");
    // Without the three bad presses the calibration is the same, within its errors.
    let good = presses.into_iter().enumerate();
    let good = good.filter(|(i, _)| ![7, 12, 22].contains(i));
    let good: Vec<_> = good.map(|(_, press)| press).collect();
    let alone = calibrate(&rig.design, &good).unwrap();
    for (coil, other) in calibration.coils().iter().zip(alone.coils()) {
        assert!(
            (coil.gain / other.gain - 1.0).abs() < 1e-3,
            "{coil:?} {other:?}"
        );
    }
}

#[test]
fn as_many_presses_as_stated_are_enough() {
    let mut rig = Rig::new(&three_around_one(), 31);
    let presses = rig.presses(45);
    let few = calibrate(&rig.design, &presses).unwrap();
    let added = few.added_errors().unwrap();
    let goal = Goal {
        place_m: added.place_m / 1.5,
        ln_force: added.ln_force / 1.3,
    };
    let more = few.more_presses(&goal).unwrap();
    assert!((45..=65).contains(&more), "{more}");
    let presses = rig.presses(45 + more as u32);
    let all = calibrate(&rig.design, &presses).unwrap();
    let reached = all.added_errors().unwrap();
    println!("{added:?}, {more} more: {reached:?}");
    assert!(reached.place_m < 1.2 * goal.place_m && reached.place_m > 0.7 * goal.place_m);
    assert_eq!(
        few.more_presses(&Goal {
            place_m: 1e-3,
            ln_force: 1.0
        })
        .unwrap(),
        0
    );
}

#[test]
fn unusable_presses_are_refused() {
    let mut rig = Rig::new(&three_around_one(), 41);
    let presses = rig.presses(30);
    assert!(calibrate(&rig.design, &presses[..24]).is_err());
    for spoil in [
        |press: &mut KnownPress| press.force_n = 0.0,
        |press: &mut KnownPress| press.readings[1] = f64::NAN,
        |press: &mut KnownPress| press.readings.truncate(3),
        |press: &mut KnownPress| press.radius_m = -1e-3,
    ] {
        let mut spoilt = presses.clone();
        spoil(&mut spoilt[3]);
        assert!(calibrate(&rig.design, &spoilt).is_err());
    }
    // All in one hole: the profile is not known elsewhere, and the errors say so.
    let one: Vec<_> = (0..30).map(|_| rig.press([1e-3, 0.0])).collect();
    let known = calibrate(&rig.design, &presses)
        .unwrap()
        .added_errors()
        .unwrap();
    if let Ok(unknown) = calibrate(&rig.design, &one) {
        let added = unknown.added_errors().unwrap();
        assert!(added.place_m > 5.0 * known.place_m, "{added:?} {known:?}");
    }
}
