//! Topics: published messages, and their expected receivers.

use super::*;

/// Numbers and texts that must arrive unchanged.
const NUMBERS: [&str; 6] = ["0", "-0.0", "1.50", "12345678901234567", "1e5", "-2.5E-3"];
const TEXTS: [&str; 5] = ["", "a b", "\\u00e9\\n", "\u{e9}\u{1f600}", "}{][,:"];

impl Workload<'_> {
    /// JSON that must arrive unchanged.
    pub(super) fn payload(&self, depth: usize) -> String {
        match self.court.below(if depth > 2 { 6 } else { 9 }) {
            0 => "null".to_owned(),
            1 => self.court.among(&NUMBERS).to_owned(),
            2 => format!("\"{}\"", self.court.among(&TEXTS)),
            3 => "true".to_owned(),
            4 => {
                let most = if self.plan.room < 1000 { 60 } else { 3000 };
                format!("\"{}\"", "x".repeat(self.court.below(most)))
            }
            5 => {
                let (small, large) = (self.number(-1.0, 1.0), self.number(-1e9, 1e9));
                format!("[{small},{large},{}]", self.court.below(9))
            }
            6 => "{}".to_owned(),
            kind => {
                let (one, other) = (self.payload(depth + 1), self.payload(depth + 1));
                match kind {
                    7 => format!("[{one},{other}]"),
                    _ => format!("{{\"a\":{one},\"b c\":{other}}}"),
                }
            }
        }
    }

    pub(super) fn publish(&mut self) {
        let topic = self.court.among(&TOPICS);
        self.advertise(topic);
        let count = self.court.among(&[1, 2, 6, 40]);
        self.publish_on(topic, count, |workload| workload.payload(0));
    }

    pub(super) fn advertise(&mut self, topic: &str) {
        if self.me().advertised.insert(topic.to_owned()) {
            let spelling = self.spelled(topic);
            self.send(&frame("advertise", "topic", &spelling, ""));
        }
    }

    /// This many messages on a topic that this client advertises.
    pub fn publish_on(&mut self, topic: &str, count: usize, payload: impl Fn(&Self) -> String) {
        let (who, link) = (self.me().who, self.me().is_active());
        for _ in 0..count {
            let (number, more) = (self.numbers.next(), payload(self));
            let body = format!("{{\"from\":{who},\"number\":{number},\"more\":{more}}}");
            let spelling = self.spelled(topic);
            let msg = match self.court.below(4) {
                0 => format!("\"id\":\"m{number}\",\"msg\":{body}"),
                _ => format!("\"msg\":{body}"),
            };
            let frame = frame("publish", "topic", &spelling, &msg);
            let is_wide = self.plan.room >= 1000;
            let size = if is_wide { self.court.below(20) } else { 0 };
            if size == 1 && body.len() > 200 {
                let style = self.style();
                self.me().send_pieces(&frame, 150, style);
            } else {
                self.court.note("sends", frame.as_bytes());
                if self.plan.together {
                    // Consecutive lines are forwarded as one op.
                    self.me().send_with_next(&frame);
                } else {
                    self.me().send(&frame, 0);
                }
            }
            let message = Message {
                topic: topic.to_owned(),
                publisher: who,
                body,
            };
            self.model.messages.insert(number, message);
            let order = self.me().frames;
            self.me().published.insert(number, order);
            self.court.count("messages published");
            let subscriptions = self
                .all
                .iter_mut()
                .flat_map(|one| one.subscriptions.values_mut());
            for one in subscriptions.filter(|one| one.topic == topic) {
                let is_on = one.phase == Phase::On && link;
                let must = is_on && one.throttle.is_none();
                let pending = one.pending.entry(who).or_default();
                pending.push_back((number, must));
                if is_on {
                    one.newest.insert(who, number);
                }
            }
        }
        self.me().flush();
    }

    /// One message on a topic that is throttled for a subscriber, if there is one. Returns the least time between two
    /// messages.
    pub fn stream(&mut self) -> Duration {
        let subscriptions = self.all.iter().flat_map(|one| one.subscriptions.values());
        let throttled = subscriptions
            .filter_map(|one| one.throttle.map(|interval| (interval, one.topic.clone())))
            .max();
        let (interval, topic) =
            throttled.unwrap_or_else(|| (Duration::from_millis(20), TOPICS[0].to_owned()));
        self.advertise(&topic);
        self.publish_on(&topic, 1, |workload| workload.payload(0));
        interval
    }

    /// More than an outbox holds, for another client that subscribes to it. Returns that client's index.
    pub fn flood(&mut self) -> Option<usize> {
        // Hostile clients request pieces on one topic. A thousand pieces of each message would take too much time.
        let subscriptions = self.all.iter().flat_map(|one| one.subscriptions.values());
        let in_pieces = subscriptions.filter(|one| one.is_in_pieces);
        let in_pieces = in_pieces.map(|one| one.topic.as_str());
        let in_pieces: Vec<&str> = in_pieces.chain([TOPICS[1]]).collect();
        let listens = |(place, one): (usize, &Honest)| {
            let mut all = one.subscriptions.values();
            let plain = all.find(|one| {
                let is_on = one.phase == Phase::On && one.throttle.is_none();
                is_on && !in_pieces.contains(&one.topic.as_str())
            })?;
            (place != self.at && one.is_active()).then(|| (place, plain.topic.clone()))
        };
        let (deaf, topic) = self.all.iter().enumerate().find_map(listens)?;
        // This is more than a client reads at once. Some messages may be dropped even for clients that read, and
        // must be counted.
        for one in self.all.iter_mut() {
            let mut all = one.subscriptions.values();
            one.is_hampered |= all.any(|one| one.topic == topic);
        }
        self.advertise(&topic);
        self.court.count("floods");
        let long = format!("\"{}\"", "x".repeat(FLOODING));
        self.publish_on(&topic, 3 * MAX_TOPIC_BYTES / 2 / FLOODING, |_| long.clone());
        Some(deaf)
    }

    pub(super) fn subscribe(&mut self, feature: Feature) {
        let topic = self.court.among(&TOPICS);
        let spelling = self.spelled(topic);
        let framing = self.me().client.framing();
        let is_binary = feature == Feature::Cbor && framing == Framing::WebSocket;
        let throttle = (feature == Feature::Throttle)
            .then(|| Duration::from_millis(20 + self.court.below(300) as u64));
        let known = self.me().subscriptions.get(&spelling);
        let differs = known.is_some_and(|one| {
            one.is_binary != is_binary || one.throttle != throttle || one.phase != Phase::On
        });
        let is_new = known.is_none();
        if differs {
            return;
        }
        let mut more = Vec::new();
        if let Some(interval) = throttle {
            more.push(format!("\"throttle_rate\":{}", interval.as_millis()));
            more.push(format!("\"queue_length\":{}", self.court.below(4)));
        }
        if feature == Feature::Pieces {
            more.push(format!(
                "\"fragment_size\":{}",
                self.court.among(&PIECE_SIZES)
            ));
        }
        if is_binary {
            more.push("\"compression\":\"cbor\"".to_owned());
        }
        self.send(&frame("subscribe", "topic", &spelling, &more.join(",")));
        self.me().await_news(format!("subscribed to {spelling}"));
        if !is_new {
            return;
        }
        let pending = self.under_way(topic);
        let subscription = Subscription {
            topic: topic.to_owned(),
            phase: Phase::Asked,
            throttle,
            is_binary,
            is_in_pieces: feature == Feature::Pieces,
            pending,
            last: None,
            last_from: None,
            newest: Default::default(),
        };
        self.me().subscriptions.insert(spelling, subscription);
    }

    /// Messages on a topic that were sent already, and may not have been handled yet.
    pub(super) fn under_way(&self, topic: &str) -> BTreeMap<u64, VecDeque<(u64, bool)>> {
        let mut pending: BTreeMap<u64, VecDeque<(u64, bool)>> = BTreeMap::new();
        for (number, message) in &self.model.messages {
            let publisher = self.all.iter().find(|one| one.who == message.publisher);
            let order = publisher.and_then(|one| Some((one.published.get(number)?, one.handled)));
            if message.topic == topic && order.is_none_or(|(order, handled)| *order >= handled) {
                let pending = pending.entry(message.publisher).or_default();
                pending.push_back((*number, false));
            }
        }
        pending
    }

    pub(super) fn unsubscribe(&mut self) {
        let spellings: Vec<String> = self.me().subscriptions.keys().cloned().collect();
        if spellings.is_empty() {
            return;
        }
        let spelling = self.court.among(&spellings);
        self.send(&frame("unsubscribe", "topic", &spelling, ""));
        let order = self.me().frames;
        if let Some(one) = self.me().subscriptions.get_mut(&spelling)
            && !matches!(one.phase, Phase::Leaving(_))
        {
            one.phase = Phase::Leaving(order);
            let pending = one.pending.values_mut().flatten();
            pending.for_each(|(_, must)| *must = false);
        }
    }
}
