//! Saves, restarts and erasures in any order, compared with a configuration in memory.

use palpate_wire::Command;
use proptest::prelude::*;

use crate::support::flash::{Flash, Remnant};
use crate::support::specimens::fullest;
use crate::support::{assert_stored, load, now, open, save};

#[derive(Clone, Debug)]
enum Step {
    /// Saves the commands whose bit is set.
    Save(u128),
    /// Saves the commands whose bit is set; the power fails after this number of flash operations.
    SaveCut(u128, u64, usize),
    Start,
    Erase,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        // Random bits select half of all commands; their product selects a few.
        4 => (any::<u128>(), any::<u128>(), any::<bool>())
            .prop_map(|(a, b, few)| Step::Save(if few { a & b & (a >> 7) } else { a })),
        2 => (any::<u128>(), 0..120u64, 0..Remnant::EVERY.len())
            .prop_map(|(a, after, remnant)| Step::SaveCut(a, after, remnant)),
        2 => Just(Step::Start),
        1 => Just(Step::Erase),
    ]
}

fn chosen(bits: u128) -> Vec<Command> {
    let commands = fullest().into_iter().enumerate();
    commands
        .filter(|(index, _)| bits >> index & 1 == 1)
        .map(|(_, command)| command)
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn the_storage_holds_what_was_saved_last(steps in prop::collection::vec(step(), 1..20)) {
        let mut flash = Flash::<4>::new();
        let mut model = Vec::new();
        for step in steps {
            let mut store = open(&mut flash).unwrap();
            match step {
                Step::Save(bits) => {
                    let new = chosen(bits);
                    prop_assert_eq!(save(&mut store, &new), Ok(()));
                    model = new;
                }
                Step::SaveCut(bits, after, remnant) => {
                    let new = chosen(bits);
                    flash.cut_after(after, Remnant::EVERY[remnant]);
                    let saved = open(&mut flash).and_then(|mut store| save(&mut store, &new));
                    prop_assert_eq!(saved.is_err(), flash.power_on());
                    store = open(&mut flash).unwrap();
                    let stored = load(&mut store).unwrap();
                    prop_assert!(stored == new || (saved.is_err() && stored == model));
                    model = stored;
                }
                Step::Start => {}
                Step::Erase => {
                    now(store.erase()).unwrap();
                    model.clear();
                }
            }
            assert_stored(&mut store, &model);
        }
    }
}
