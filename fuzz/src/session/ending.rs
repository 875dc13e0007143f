//! The end of a session: all clients read, and no expected message is lost.

use super::*;

impl Session {
    /// All clients read, every call is answered, and all clients disconnect.
    pub(super) async fn end(&mut self) {
        for player in &self.players {
            player.client.pause(false);
        }
        // A client that has not read for long is disconnected by now. Nothing is expected for it any more.
        self.pass(Duration::from_millis(5)).await;
        self.stage.release_all();
        let mut waited = Duration::ZERO;
        while waited < LONGEST_TIMEOUT + Duration::from_secs(5) && !self.all_answered() {
            let step = self.patience(1000, waited);
            self.pass(step).await;
            self.stage.release_all();
            self.hear();
            waited += step;
        }
        for player in &self.players {
            if player.is_owed() {
                let unanswered = player.answered.iter().find(|(_, count)| **count != 1);
                assert_eq!(unanswered, None, "a call and its answers");
            }
        }
        if !self.is_scarce {
            self.exchange().await;
        }
        for player in &self.players {
            player.client.finish();
        }
        // A client that disconnects gets the rest, but its answers may be missing.
        let limit = STALL_LIMIT + RESPONSES_TIME + 2 * LINGER + Duration::from_secs(5);
        let mut waited = Duration::ZERO;
        while waited < limit && !self.has_emptied() {
            let step = self.patience(250, waited);
            sleep(step).await;
            waited += step;
        }
        for player in &mut self.players {
            player.is_excused = true;
        }
        self.hear();
        let left = (self.stage.gauges.connections(), self.stage.gauges.memory());
        assert!(self.has_emptied(), "left when all have left: {left:?}");
    }

    /// Lets the remaining clients send messages and calls to each other, none of which may be lost, because all of
    /// them read.
    pub(super) async fn exchange(&mut self) {
        let left: Vec<u8> = (0..CLIENTS as u8)
            .filter(|client| self.player(*client).is_owed())
            .collect();
        let topic = quoted(LAST_TOPIC);
        for &client in &left {
            let player = self.player(client);
            player.forwarded.clear();
            for frame in [
                format!("{{\"op\":\"subscribe\",\"topic\":{topic}}}"),
                format!("{{\"op\":\"advertise\",\"topic\":{topic}}}"),
                format!("{{\"op\":\"advertise_service\",\"service\":\"{LAST_TOPIC}/{client}\"}}"),
            ] {
                player.client.send(&frame, 0);
            }
        }
        self.pass(Duration::from_millis(5)).await;
        for &client in &left {
            for _ in 0..LAST_MESSAGES {
                let more = VALUES[(self.messages as usize + 1) % VALUES.len()];
                let frame = self.message(client, LAST_TOPIC, more);
                self.player(client).client.send(&frame, 0);
            }
            for &provider in &left {
                self.calls += 1;
                let id = format!("{ID}{}", self.calls);
                let more = VALUES[self.calls as usize % VALUES.len()];
                self.book.borrow_mut().call(&id, more);
                self.player(client).answered.insert(id.clone(), 0);
                let frame = format!(
                    "{{\"op\":\"call_service\",\"service\":\"{LAST_TOPIC}/{provider}\",\"id\":\"{id}\",\"args\":{{\"call\":\"{id}\",\"more\":{more}}}}}"
                );
                self.player(client).client.send(&frame, 0);
            }
        }
        // A client's next frame is read after the answer, so the answers arrive in order.
        for _ in 0..2 * CLIENTS {
            self.pass(Duration::from_millis(5)).await;
            for &client in &left {
                for call in std::mem::take(&mut self.player(client).forwarded) {
                    let frame = self.response(&call, true, VALUES[call.0.len() % VALUES.len()]);
                    self.player(client).client.send(&frame, 0);
                }
            }
        }
        self.pass(Duration::from_millis(5)).await;
        let is_forged = self.book.borrow().is_forged;
        for &client in left.iter().filter(|_| !is_forged) {
            let player = self.player(client);
            let rest = player.client.rest();
            assert!(player.is_owed(), "{client} has ended: {rest}");
            let unanswered = player.answered.iter().find(|(_, count)| **count != 1);
            assert_eq!(unanswered, None, "a call in the end and its answers");
            for &from in &left {
                let received = player
                    .last
                    .iter()
                    .filter(|(one, _)| *one == u64::from(from));
                assert_eq!(
                    received.count() as u64,
                    LAST_MESSAGES,
                    "messages of {from} that {client} received"
                );
            }
        }
    }

    /// Time before the next check.
    pub(super) fn patience(&self, milliseconds: u64, waited: Duration) -> Duration {
        let soon = waited.is_zero() || self.has_arm;
        Duration::from_millis(if soon { 10 } else { milliseconds })
    }

    pub(super) fn has_emptied(&self) -> bool {
        let mut players = self.players.iter();
        self.stage.is_empty() && players.all(|player| player.client.has_ended())
    }

    pub(super) fn all_answered(&self) -> bool {
        let mut owed = self.players.iter().filter(|player| player.is_owed());
        owed.all(|player| player.answered.values().all(|count| *count == 1))
    }
}
