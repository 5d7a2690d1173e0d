//! The calibration rig: the user's readings against the true state.

use crate::common::*;
use palpate_sim::mechanics::load::Load;
use palpate_sim::rig::{BareRig, Rig, Specimen};
use palpate_sim::switches::Switches;
use palpate_sim::thermal::CALIBRATION_C;

const SPRING: Specimen = Specimen::Spring {
    nominal_n_per_m: 5e3,
};

#[test]
fn a_perfect_rig_reads_what_is_there() {
    let plant = plant("ultrasoft", 1);
    let mut rig = Rig::new(&plant, Switches::none(), SPRING).unwrap();
    rig.move_stage(0.7e-3, 2e-3);
    rig.world_mut().advance(ms(1_000));
    let (reading, truth) = (rig.read(), rig.world().truth());
    assert_eq!(reading.force_n, truth.force_n);
    assert_eq!(reading.stage_m, truth.press_m);
    assert_eq!(rig.world().load(), &Load::Spring { n_per_m: 5e3 });
    // Travel over force is the compliance of load, actuated layer and sensing layer in series: less
    // the first two it is exactly that of the sensing layer.
    let series = 0.7e-3 / reading.force_n - 1.0 / 5e3 - 1.0 / truth.actuated_spring_n_per_m;
    assert!((series * plant.sensing.spring_n_per_m - 1.0).abs() < 1e-12);
}

#[test]
fn load_cell_and_stage_are_off_by_their_errors() {
    let mut plant = plant("ultrasoft", 1);
    plant.rig.load_cell_gain_error = 1e-3;
    let mut rig = Rig::new(&plant, Switches::only("load_cell_gain").unwrap(), SPRING).unwrap();
    rig.move_stage(1e-3, 5e-3);
    rig.world_mut().advance(ms(1_000));
    let truth = rig.world().truth();
    assert!((rig.read().force_n / truth.force_n - 1.001).abs() < 1e-12);

    let mut rig = Rig::new(&plant, Switches::only("load_cell_noise").unwrap(), SPRING).unwrap();
    rig.world_mut().advance(ms(10));
    let readings: Vec<f64> = (0..4_000).map(|_| rig.read().force_n).collect();
    let rms = (readings.iter().map(|f| f * f).sum::<f64>() / 4_000.0).sqrt();
    assert!((rms / 1e-3 - 1.0).abs() < 0.05, "{rms} N");

    let mut rig = Rig::new(
        &plant,
        Switches::only("stage_error").unwrap(),
        Specimen::Block,
    )
    .unwrap();
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for step in 0..50 {
        rig.move_stage(1e-5 * f64::from(step), 1e-3);
        rig.world_mut().advance(ms(300));
        let error = rig.read().stage_m - rig.world().truth().press_m;
        (least, most) = (least.min(error), most.max(error));
    }
    assert!(
        (most - 1e-6).abs() < 0.02e-6 && (least + 1e-6).abs() < 0.02e-6,
        "{least} {most}"
    );
}

#[test]
fn the_rigs_springs_are_off_within_their_tolerance() {
    let (mut low, mut high) = (1.0_f64, 1.0_f64);
    for seed in 0..200 {
        let rig = Rig::new(&plant("ultrasoft", seed), Switches::all(), SPRING).unwrap();
        let Load::Spring { n_per_m } = *rig.world().load() else {
            panic!("it is a spring")
        };
        (low, high) = (low.min(n_per_m / 5e3), high.max(n_per_m / 5e3));
    }
    assert!(
        low > 0.99 && low < 0.9905 && high < 1.01 && high > 1.0095,
        "{low} {high}"
    );
    // Each spring is a specimen of its own, and the same one every time.
    let of = |nominal: f64| {
        let specimen = Specimen::Spring {
            nominal_n_per_m: nominal,
        };
        match *Rig::new(&plant("ultrasoft", 1), Switches::all(), specimen)
            .unwrap()
            .world()
            .load()
        {
            Load::Spring { n_per_m } => n_per_m / nominal,
            _ => f64::NAN,
        }
    };
    assert_eq!(of(5e3), of(5e3));
    assert_ne!(of(5e3), of(6e3));
}

#[test]
fn the_frame_is_the_rigs_and_a_block_shows_it() {
    let mut plant = plant("ultrasoft", 1);
    plant.rig.frame_m_per_n = 1.0 / 700e3;
    let mut bare = BareRig::new(&plant, Switches::only("rig_frame").unwrap());
    let reading = bare.press(20.0);
    assert!((reading.force_n / reading.stage_m / 700e3 - 1.0).abs() < 1e-12);
    assert_eq!(
        BareRig::new(&plant, Switches::none()).press(20.0).stage_m,
        0.0
    );

    let rig = Rig::new(&plant, Switches::all(), Specimen::Block).unwrap();
    assert!((rig.world().truth().load_spring_n_per_m / 700e3 - 1.0).abs() < 1e-12);
}

#[test]
fn the_rig_is_at_the_temperature_of_calibration() {
    let plant = plant("ultrasoft", 1);
    assert!(plant.thermal.ambient_change_k != 0.0);
    let mut rig = Rig::new(&plant, Switches::all(), SPRING).unwrap();
    rig.world_mut().advance(ms(100));
    let truth = rig.world().truth();
    assert_eq!([truth.ambient_c, truth.pad_c], [CALIBRATION_C; 2]);
    assert_eq!(truth.growth_m, 0.0);
    // The sensor on the rig is the sensor of the measurement.
    let measured = world(&plant, Switches::none(), pressed(&plant));
    let same = measured.truth().sensing_spring_n_per_m;
    assert_eq!(truth.sensing_spring_n_per_m, same);
}
