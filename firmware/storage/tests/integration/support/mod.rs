//! Common functions of several tests and of the campaign.

#![allow(dead_code, reason = "no program uses all of it")]

pub(crate) mod cuts;
pub(crate) mod damage;
pub(crate) mod flash;
pub(crate) mod raw;
pub(crate) mod specimens;

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use embedded_storage_async::nor_flash::NorFlash;
use palpate_storage::{Contents, Error, Set, Store};
use palpate_wire::{Command, configuration_crc};

use flash::{AREA, Flash};

/// Returns the result of a future that never waits.
pub(crate) fn now<T>(future: impl Future<Output = T>) -> T {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result,
        Poll::Pending => panic!("the future waits"),
    }
}

/// Opens the storage in the whole area of a flash.
pub(crate) fn open<S: NorFlash>(flash: S) -> Result<Store<S>, Error<S::Error>> {
    now(Store::open(flash, 0..AREA as u32))
}

/// Saves a configuration.
pub(crate) fn save<S: NorFlash>(
    store: &mut Store<S>,
    commands: &[Command],
) -> Result<(), Error<S::Error>> {
    now(store.begin())?;
    for command in commands {
        now(store.put(command))?;
    }
    now(store.commit())
}

/// Returns all stored commands.
pub(crate) fn load<S: NorFlash>(store: &mut Store<S>) -> Result<Vec<Command>, Error<S::Error>> {
    store.rewind();
    let mut commands = Vec::new();
    while let Some(command) = now(store.next(&specimens::defaults()))? {
        commands.push(command);
    }
    Ok(commands)
}

/// Returns the stored set, which must be whole.
pub(crate) fn whole<S: NorFlash>(store: &Store<S>) -> Set {
    match store.contents() {
        Contents::Whole(set) => set,
        other => panic!("{other:?}"),
    }
}

/// Checks that a storage contains a configuration and reports it as whole.
#[track_caller]
pub(crate) fn assert_stored<S: NorFlash>(store: &mut Store<S>, commands: &[Command]) {
    assert_eq!(load(store).unwrap(), commands);
    if commands.is_empty() {
        assert_eq!(store.contents(), Contents::Empty);
    } else {
        let crc = configuration_crc(commands);
        assert_eq!(whole(store).configuration_crc, crc);
    }
}

/// Returns a flash after saves of configurations, one after the other.
pub(crate) fn saved(configurations: &[Vec<Command>]) -> Flash {
    let mut flash = Flash::new();
    let mut store = open(&mut flash).unwrap();
    for commands in configurations {
        save(&mut store, commands).unwrap();
    }
    flash
}

/// Returns the smallest and the largest erase count of the sectors after saves of different sets.
pub(crate) fn wear(saves: u32, of: impl Fn(u32) -> Vec<Command>) -> (u32, u32) {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    for number in 0..saves {
        save(&mut store, &of(number)).unwrap();
    }
    assert_stored(&mut store, &of(saves - 1));
    let wear = flash.wear.iter();
    (*wear.clone().min().unwrap(), *wear.max().unwrap())
}
