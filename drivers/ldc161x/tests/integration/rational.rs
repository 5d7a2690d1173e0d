//! Words as ratios of counts, compared with words of real boards and with a brute-force search.

use ldc161x::{
    Code28, Hypothesis, PlausibilityCount, RatioOfSums, Rational, Rcount, Scale, Window,
};
use proptest::prelude::*;

/// The posted words, as (clock in hertz, RCOUNT, word). The first five were posted as frequencies.
fn posted() -> Vec<(f64, u16, u32)> {
    let word = |hz: f64| (hz / 12e6 * 268_435_456.0).round() as u32;
    vec![
        (12e6, 1512, word(3_187_030.882)),
        (12e6, 1512, word(3_187_015.414)),
        (12e6, 1512, word(3_187_065.84)),
        (12e6, 1512, word(3_187_081.307)),
        (12e6, 1512, word(3_186_833.203)),
        (12e6, 3049, 0x43C_923B),
        (12e6, 3049, 0x435_4E00),
        (12e6, 3049, 0x443_36D2),
        (12e6, 3049, 0xB3D_3D64),
        (12e6, 1512, 0x440_9E8B),
    ]
}

/// Tries every N of the window in floating point, by the definition of the hypothesis.
fn brute_force(word: u32, rcount: u16, window: Window) -> (u32, u32, f64) {
    let full = 268_435_456.0;
    (window.lowest..=window.highest)
        .map(|n| {
            let m = (f64::from(word) * f64::from(n) / full).round();
            (m as u32, n, f64::from(word) - full * m / f64::from(n))
        })
        .min_by(|a, b| (a.2.abs() * f64::from(a.1)).total_cmp(&(b.2.abs() * f64::from(b.1))))
        .unwrap_or_else(|| panic!("no candidate at RCOUNT {rcount}"))
}

#[test]
fn every_posted_word_is_a_ratio_within_the_published_window() {
    for (_, rcount, word) in posted() {
        let ratio = Rational::decode(Code28::new(word).unwrap(), Rcount::new(rcount).unwrap());
        let gate = 32 * u32::from(rcount);
        assert_eq!(ratio.plausible, Some(true), "{word:#x}: {ratio:?}");
        assert!(ratio.residual_lsb.abs() < 0.6, "{word:#x}: {ratio:?}");
        assert!(
            (gate - 30..=gate - 10).contains(&ratio.n),
            "{word:#x}: {ratio:?}"
        );
    }
}

/// The published counts were read by hand from the table of posted words.
#[test]
fn posted_words_have_the_published_counts() {
    for (rcount, word, m, n) in [
        (1512, 0x440_9E8B, 12_854, 48_364),
        (3049, 0x43C_923B, 25_829, 97_546),
        (3049, 0x435_4E00, 25_657, 97_550),
        (3049, 0x443_36D2, 25_988, 97_549),
        (3049, 0xB3D_3D64, 68_522, 97_547),
    ] {
        let ratio = Rational::decode(Code28::new(word).unwrap(), Rcount::new(rcount).unwrap());
        assert_eq!((ratio.m, ratio.n), (m, n), "{word:#x}");
    }
}

/// A generator with a published recurrence (Knuth's MMIX constants), independent of the driver.
struct Lcg(u64);

impl Lcg {
    fn word(&mut self) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 36) as u32
    }
}

#[test]
fn of_random_words_three_to_seven_in_a_thousand_fit() {
    let rcount = Rcount::new(1512).unwrap();
    for seed in 1..=3 {
        let mut random = Lcg(seed);
        let mut count = PlausibilityCount::default();
        for _ in 0..100_000 {
            count.add(&Rational::decode(
                Code28::new(random.word()).unwrap(),
                rcount,
            ));
        }
        assert!(
            (300..=700).contains(&count.plausible),
            "seed {seed}: {count:?}"
        );
        assert_eq!(count.hypothesis(), Hypothesis::Fails);
        // The stated false-accept rate agrees with the observed one, within five standard
        // deviations of a count.
        let difference = count.plausible as f32 - count.expected_by_chance;
        assert!(
            difference.abs() < 5.0 * count.expected_by_chance.sqrt(),
            "{count:?}"
        );
    }
}

#[test]
fn the_hypothesis_is_undecided_where_chance_would_do_as_well() {
    let mut count = PlausibilityCount::default();
    let mut random = Lcg(7);
    for _ in 0..100 {
        // At the longest conversion more than a third of all random words are plausible.
        count.add(&Rational {
            false_accept: 0.6,
            plausible: Some(random.word() % 10 < 9),
            ..exact()
        });
    }
    assert_ne!(count.hypothesis(), Hypothesis::Holds);
}

fn exact() -> Rational {
    Rational::decode(Code28::new(0x440_9E8B).unwrap(), Rcount::new(1512).unwrap())
}

/// For words that are ratios of counts, the sum of M over the sum of N is their exact mean.
#[test]
fn the_ratio_of_sums_is_exact() {
    let mut sums = RatioOfSums::default();
    let (mut m, mut n) = (0_u64, 0_u64);
    for step in 0..1_000_u64 {
        let (counts, periods) = (12_854 + step % 5, 48_364 + step % 3);
        let word = ((counts << 28) as f64 / periods as f64).round() as u32;
        let ratio = Rational::decode(Code28::new(word).unwrap(), Rcount::new(1512).unwrap());
        assert_eq!((u64::from(ratio.m), u64::from(ratio.n)), (counts, periods));
        sums.add(&ratio);
        (m, n) = (m + counts, n + periods);
    }
    assert_eq!(sums.ratio(), Some(m as f64 / n as f64));
}

/// The mean of the stated quantisation over all phases is the published 1 / (sqrt(12) fREF tC).
#[test]
fn the_stated_sigma_averages_to_the_published_one() {
    let scale = Scale::undivided(40e6, Rcount::new(2500).unwrap());
    let steps = 10_000;
    // From 4 to 5 reference periods in half a sensor period: this covers every phase once.
    let mean_square: f64 = (0..steps)
        .map(|step| {
            let half_period = 4.0 + f64::from(step) / f64::from(steps);
            let code = (134_217_728.0 / half_period) as u32;
            f64::from(scale.relative_sigma(Code28::new(code).unwrap())).powi(2)
        })
        .sum::<f64>()
        / f64::from(steps);
    let published = 1.0 / (12_f64.sqrt() * 40e6 * 1e-3);
    assert!(
        (mean_square.sqrt() / published - 1.0).abs() < 0.01,
        "{}",
        mean_square.sqrt()
    );
}

proptest! {
    #[test]
    fn decoding_finds_what_brute_force_finds(word in 1_u32..1 << 28, rcount in 9_u16..) {
        let window = Window::of(Code28::new(word).unwrap(), Rcount::new(rcount).unwrap());
        let ratio = Rational::decode(Code28::new(word).unwrap(), Rcount::new(rcount).unwrap());
        let (_, _, best) = brute_force(word, rcount, window);
        prop_assert!(window.lowest <= ratio.n && ratio.n <= window.highest);
        let full = 268_435_456.0;
        let residual = f64::from(word) - full * f64::from(ratio.m) / f64::from(ratio.n);
        prop_assert!((f64::from(ratio.residual_lsb) - residual).abs() < 1e-4 * residual.abs() + 1e-5);
        // If two candidates for N are equally near, either may be chosen.
        prop_assert!((residual.abs() - best.abs()).abs() < 0.01 * best.abs() + 1e-3);
    }

    #[test]
    fn every_ratio_in_the_window_is_plausible(
        rcount in 9_u16..,
        share in 0.027_f64..0.25,
        deficit in 10_u32..=19,
    ) {
        let n = 32 * u32::from(rcount) - deficit;
        let m = (share * f64::from(n)).round().max(1.0);
        let word = (268_435_456.0 * m / f64::from(n)).round() as u32;
        let ratio = Rational::decode(Code28::new(word).unwrap(), Rcount::new(rcount).unwrap());
        // In short conversions a slow sensor's window exceeds half a gate: the word is not judged.
        let judged = 16 * u32::from(rcount) >= 11 + 5 * (1_u32 << 28) / word.max(1);
        prop_assert_eq!(ratio.plausible, judged.then_some(true), "{:?}", ratio);
    }
}

/// For sensors below 1/37 of the reference, N may lie outside the window that is searched: the
/// words of such a sensor are neither called corrupt nor counted.
#[test]
fn words_of_slow_sensors_are_not_judged() {
    let rcount = Rcount::new(2500).unwrap();
    let judged = |periods: u32| {
        let word = Code28::new((1 << 28) / periods).unwrap();
        Rational::decode(word, rcount).plausible
    };
    assert_eq!(judged(37), Some(true));
    assert_eq!(judged(39), None);
    let mut count = PlausibilityCount::default();
    count.add(&Rational::decode(Code28::new(3_019_899).unwrap(), rcount));
    assert_eq!(count, PlausibilityCount::default());
}
