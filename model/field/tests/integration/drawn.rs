//! Estimated errors of drawn designs: built-in designs with numbers changed at random.

use palpate_field::design::{BUILTIN, Design, builtin_text, vary};
use palpate_field::figures::Figures;
use palpate_field::solve::{Accuracy, Excitation, Figure, Wanted, solve_for};

/// Numbers that are changed, with the least and the greatest factor.
const VARIED: [(&str, f64, f64); 12] = [
    ("parameters.gap", 0.6, 1.5),
    ("parameters.plate", 0.5, 2.0),
    ("parameters.rim", 0.4, 1.8),
    ("parameters.disc", 0.6, 1.05),
    ("core.r", 0.6, 1.2),
    ("material.mse.mu_r", 0.5, 2.5),
    ("material.permalloy.mu_r", 0.001, 1.0),
    ("material.permalloy.initial_mu_r", 0.01, 1.0),
    ("material.permalloy.knee_T", 0.7, 1.3),
    ("body.mse.shape.semi_r", 0.9, 1.3),
    ("body.mse.shape.semi_x", 0.95, 1.3),
    ("conductor.current_A", 0.3, 2.0),
];

/// Random numbers from 0 to 1 (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A design and its excitation: at its current with saturation, or at one ampere.
fn drawn(seed: u64) -> (Design, Excitation) {
    let mut random = Random(seed.wrapping_mul(0x0123_4567));
    let name = BUILTIN[(random.next() * BUILTIN.len() as f64) as usize];
    let text = builtin_text(name).expect("built in");
    // Numbers that make no design are drawn again.
    for _ in 0..50 {
        let mut settings = Vec::new();
        for (path, low, high) in VARIED {
            let (is_changed, share) = (random.next() >= 0.4, random.next());
            if let (true, Ok(value)) = (is_changed, vary::get(text, path)) {
                let value = value * low * (high / low).powf(share);
                // Four digits, as a user would write.
                let digit = 10.0_f64.powf(value.log10().floor() - 3.0);
                settings.push((path.to_owned(), (value / digit).round() * digit));
            }
        }
        let design = vary::set(text, &settings)
            .ok()
            .and_then(|text| Design::parse(name, &text).ok());
        if let Some(design) = design {
            let excitation = if random.next() < 0.4 {
                Excitation::saturating(&design, design.current_a)
            } else {
                Excitation::small(&design, 1.0)
            };
            return (design, excitation);
        }
    }
    panic!("seed {seed} gives no design");
}

const ALL: [Figure; 10] = [
    Figure::Centre,
    Figure::CoreMean,
    Figure::CvWhole,
    Figure::CvThreeQuarters,
    Figure::CvHalf,
    Figure::AxialPp,
    Figure::RadialPp,
    Figure::Linkage,
    Figure::Force,
    Figure::PlateMax,
];

fn values(f: &Figures) -> [f64; 10] {
    let [r8, r6, r4] = f.cv;
    [
        f.centre_t,
        f.core_mean_t,
        r8,
        r6,
        r4,
        f.axial_pp,
        f.radial_pp,
        f.linkage_wb,
        f.force_n,
        f.plate_max_t,
    ]
}

/// A number from the environment.
fn number(name: &str, default: u64) -> u64 {
    let text = std::env::var(name).ok();
    text.map_or(default, |text| text.parse().expect("a number"))
}

/// The estimate of every figure covers its error, as far as that is known from elements of fifth
/// order at 3e-6. For more designs: `DRAWN_DESIGNS=200 DRAWN_SEED=2001 cargo test -p palpate-field
/// --release --test integration drawn -- --nocapture`, which prints how many estimates cover, and
/// the ratios of estimate and error.
#[test]
fn estimates_cover_the_errors_of_drawn_designs() {
    let (count, first) = (number("DRAWN_DESIGNS", 4), number("DRAWN_SEED", 1));
    let mut ratios = vec![Vec::new(); ALL.len()];
    let (mut uncovered, mut over, mut judged) = (0, 0, 0);
    for seed in first..first + count {
        let (design, excitation) = drawn(seed);
        let solved = |relative: f64, order: u32, wanted: Wanted<'_>| {
            let accuracy = Accuracy {
                relative,
                order,
                most_unknowns: 90_000,
            };
            solve_for(&design, &excitation, &accuracy, wanted).expect("a field")
        };
        let found = solved(1e-4, 3, Wanted::Figures);
        let truth = solved(3e-6, 5, Wanted::Only(&ALL));
        let [value, estimate] = [&found.figures, &found.errors].map(values);
        let [true_value, unknown] = [&truth.figures, &truth.errors].map(values);
        let mut covers = true;
        for (index, ratios) in ratios.iter_mut().enumerate() {
            let error = (value[index] - true_value[index]).abs();
            // If the reference's own error may exceed half of the difference, the true error is unknown.
            if true_value[index] == 0.0 || unknown[index] > 0.5 * error {
                continue;
            }
            judged += 1;
            ratios.push(estimate[index] / error);
            over += usize::from(estimate[index] > 10.0 * (error + unknown[index]));
            if estimate[index] < error - unknown[index] {
                covers = false;
                println!(
                    "{seed}, {}: {:?} covers {:.2} of its error",
                    design.name,
                    ALL[index],
                    estimate[index] / error
                );
            }
        }
        uncovered += usize::from(!covers);
    }
    for (figure, ratios) in ALL.iter().zip(&mut ratios) {
        ratios.sort_by(f64::total_cmp);
        if let [least, .., greatest] = ratios[..] {
            let middle = ratios[ratios.len() / 2];
            let within = ratios.iter().filter(|ratio| (1.0..=10.0).contains(*ratio));
            println!(
                "{figure:?}: {} judged, estimate over error {least:.2} to {greatest:.1}, median {middle:.1}, {} from 1 to 10",
                ratios.len(),
                within.count()
            );
        }
    }
    println!(
        "{uncovered} of {count} designs not covered; of {judged} figures {over} above 10 times the error"
    );
    assert!(judged > 4 * count as usize, "{judged} figures judged");
    assert!(200 * uncovered <= count as usize, "{uncovered} of {count}");
}
