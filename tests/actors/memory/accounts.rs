//! Accounts, without a gateway: what counts, what is given back, and who is asked for it.

use std::sync::Arc;

use super::*;
use bytes::Bytes;
use pendularm::actors::gateway::limits::MAX_CONNECTIONS;
use pendularm::actors::resources::aside::PLACES;
use pendularm::actors::resources::budget::{
    Account, CONNECTION_BYTES, MAX_HELD, MAX_MEMORY, MESSAGES_LEFT, MODEST_PART, NoRoom,
};
use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES, PLACE_BYTES};
use pendularm::protocol::ros::tree::NODE_BYTES;
use tokio::time::timeout;

/// Whether an account is asked for its connection (true), for its messages (false), or for nothing.
async fn asked(account: &Account) -> Option<bool> {
    timeout(Duration::from_millis(1), account.asked())
        .await
        .ok()
}

#[test]
fn the_limits_are_as_the_papers_say_and_leave_room_for_every_client() {
    const { assert!(MAX_HELD == 384 * MIB && MAX_MEMORY == 640 * MIB) };
    // A client that never gives way, times all that there may be.
    const { assert!(MAX_CONNECTIONS * MODEST <= MAX_HELD) };
    const { assert!(CONNECTION_BYTES + MESSAGES_LEFT < MODEST) };
    // The memory that is counted, a quarter of it for the allocator, and the program itself.
    const { assert!(MAX_HELD / 4 * 5 + 64 * MIB <= MAX_MEMORY) };
    // While nobody else is there, whatever docs/protocol.md accepts fits: a frame and all that is made of it.
    const { assert!(10 * MAX_FRAME + MAX_TOPIC_BYTES < MAX_HELD) };
    // So do the longest messages that are put into another form at a time, with their trees: 12 bytes for one, and 4.
    const { assert!(NODE_BYTES / 2 == 12 && PLACES * (12 + 4) * MAX_FRAME <= MAX_HELD / 2) };
}

#[test]
fn what_is_taken_is_given_back_with_the_last_copy() {
    let memory = Memory::of(MIB);
    let account = memory.open();
    assert_eq!(
        (memory.held(), account.held()),
        (CONNECTION_BYTES, CONNECTION_BYTES)
    );
    let frame = account.count(Bytes::from(vec![7; 400]));
    let copy = frame.slice(10..20);
    drop(frame);
    let with_frame = CONNECTION_BYTES + 400 + FRAME_BYTES;
    assert_eq!((memory.held(), account.held()), (with_frame, with_frame));
    assert_eq!(copy, [7; 10][..]);
    drop(copy);
    let mut share = account.take(100);
    for bytes in [0, 300, 200] {
        share.resize(bytes);
        assert_eq!(
            (share.bytes(), memory.held()),
            (bytes, CONNECTION_BYTES + bytes)
        );
    }
    account.queue(3, 1000, 0);
    let places = 3 * PLACE_BYTES;
    assert_eq!(account.messages(), 1000 + places + 3 * FRAME_BYTES);
    assert_eq!(
        memory.held(),
        CONNECTION_BYTES + 200 + places,
        "messages count where they are made"
    );
    // A share outlives its connection, which is charged for as long.
    drop(account);
    assert_eq!(memory.held(), CONNECTION_BYTES + 200 + places);
    drop(share);
    assert_eq!(memory.held(), 0);
}

#[test]
fn a_message_counts_once_in_all_and_whole_for_each_who_waits_for_it() {
    let memory = Memory::of(MIB);
    let (one, other) = (memory.open(), memory.open());
    let at_rest = memory.held();
    let frame = memory.count(Bytes::from(vec![0; 1000]));
    for account in [&one, &other] {
        account.queue(1, frame.len(), 0);
        // Short messages cost more than their bytes: whoever hoards a million of them is no modest client.
        let each = 1000 + FRAME_BYTES + PLACE_BYTES;
        assert_eq!(account.held(), CONNECTION_BYTES + each);
    }
    assert_eq!(
        memory.held(),
        at_rest + 1000 + FRAME_BYTES + 2 * PLACE_BYTES
    );
    drop(frame);
    for account in [&one, &other] {
        account.queue(0, 0, 0);
    }
    assert_eq!(memory.held(), at_rest);
}

#[test]
fn the_largest_gives_way_first_and_only_until_the_rest_fits() {
    in_virtual_time(async {
        let memory = Memory::of(8 * MIB);
        let accounts: Vec<Arc<Account>> = (0..4).map(|_| memory.open()).collect();
        let mut shares: Vec<_> = accounts
            .iter()
            .zip([1, 3, 2, 1])
            .map(|(account, megabytes)| account.take(megabytes * MIB))
            .collect();
        for account in &accounts {
            assert_eq!(asked(account).await, None);
        }
        // The one that asks for more may be a small one: the largest gives way.
        let more = accounts[0].take(MIB);
        for (account, gives_way) in accounts.iter().zip([None, Some(true), None, None]) {
            assert_eq!(asked(account).await, gives_way);
        }
        // A client that is leaving is not waited for twice, nor asked again; bytes on top are the next one's turn.
        let other = accounts[3].take(MIB);
        assert_eq!((asked(&accounts[2]).await, memory.cut_off()), (None, 1));
        let much = accounts[2].take(2 * MIB);
        assert_eq!(
            (asked(&accounts[2]).await, memory.cut_off()),
            (Some(true), 2)
        );
        assert_eq!(asked(&accounts[0]).await, None);
        shares.clear();
        drop((more, other, much, accounts));
        assert_eq!(memory.held(), 0);
    });
}

#[test]
fn messages_go_first_and_the_connection_if_that_is_not_enough() {
    in_virtual_time(async {
        let memory = Memory::of(4 * MIB);
        let (hog, other) = (memory.open(), memory.open());
        let frame = memory.count(Bytes::from(vec![0; 2 * MIB]));
        hog.queue(1, frame.len(), 0);
        let share = hog.take(MIB);
        let rest = other.take(MIB);
        assert_eq!(asked(&hog).await, Some(false));
        drop(frame);
        hog.queue(0, 0, 0);
        hog.gave_messages();
        assert_eq!(asked(&hog).await, None);
        let more = hog.take(3 * MIB);
        assert_eq!((asked(&hog).await, asked(&other).await), (Some(true), None));
        drop((share, rest, more));
    });
}

/// Freeing the messages of a client that is gone takes a while, on another thread.
#[test]
fn nobody_gives_way_for_what_is_being_freed() {
    in_virtual_time(async {
        let memory = Memory::of(4 * MIB);
        let (gone, other) = (memory.open(), memory.open());
        let frame = memory.count(Bytes::from(vec![0; 3 * MIB]));
        gone.queue(1, frame.len(), 0);
        let freed = gone.freeing();
        gone.queue(0, 0, 0);
        let share = other.take(2 * MIB);
        assert_eq!(asked(&other).await, None);
        drop((frame, freed));
        let more = other.take(MIB);
        assert_eq!(asked(&other).await, None);
        let too_much = other.take(MIB);
        assert_eq!(asked(&other).await, Some(true));
        drop((share, more, too_much));
    });
}

#[test]
fn who_holds_little_never_gives_way() {
    in_virtual_time(async {
        let memory = Memory::of(MIB);
        let accounts: Vec<Arc<Account>> = (0..8).map(|_| memory.open()).collect();
        let shares: Vec<_> = accounts
            .iter()
            .map(|account| account.take(MODEST - CONNECTION_BYTES))
            .collect();
        assert!(memory.held() > MIB);
        for account in &accounts {
            assert_eq!(asked(account).await, None);
        }
        let _one_more = accounts[5].take(1);
        assert_eq!(asked(&accounts[5]).await, Some(true));
        drop(shares);
    });
}

#[test]
fn who_finds_no_room_for_an_answer_is_told_whether_it_is_worth_waiting() {
    let memory = Memory::of(8 * MIB);
    let (one, other) = (memory.open(), memory.open());
    let computing = one.promise(4 * MIB, false).unwrap();
    assert_eq!(other.promise(4 * MIB, true).unwrap_err(), NoRoom::Yet);
    let never = other.promise(8 * MIB, false);
    assert_eq!(never.unwrap_err(), NoRoom::Now, "it never fits");
    let answer = computing.cover(Bytes::from(vec![0; 4 * MIB]));
    let before = memory.held();
    assert_eq!(other.promise(4 * MIB, false).unwrap_err(), NoRoom::Now);
    // The client that would hold most is refused; one that asks for less has it, and if need be the largest gives way.
    let as_much = other.promise(4 * MIB + FRAME_BYTES, true);
    assert_eq!(as_much.unwrap_err(), NoRoom::Now);
    assert_eq!(memory.held(), before, "what is refused comes off again");
    drop(other.promise(7 * MIB / 2, true).unwrap());
    drop(answer);
    drop(other.promise(4 * MIB, false).unwrap());
    assert_eq!(memory.held(), 2 * CONNECTION_BYTES);
}

/// Six answers of a million steps fill what there is for such; whoever asks for a modest one has it.
#[test]
fn a_modest_answer_finds_room_beside_long_ones() {
    let memory = Memory::default();
    let accounts: Vec<_> = (0..200).map(|_| memory.open()).collect();
    let million = 99 * 1_000_000;
    let long: Vec<_> = accounts[..6]
        .iter()
        .filter_map(|account| account.promise(million, false).ok())
        .collect();
    assert!((1..6).contains(&long.len()), "no room is left for another");
    let modest = MAX_HELD / MODEST_PART;
    let longer = accounts[6].promise(2 * modest, false);
    assert!(longer.is_err(), "the next eighth is for modest ones");
    let given: Vec<_> = accounts[6..13]
        .iter()
        .map(|account| account.promise(modest, false))
        .collect();
    assert!(given.iter().all(Result::is_ok), "{given:?}");
    // Bytes that need no promise have their part besides.
    assert!(memory.held() <= MAX_HELD / 8 * 7);
    drop((long, given));
    drop(accounts);
    assert_eq!(memory.held(), 0);
}
