//! Services of clients: provided, withdrawn, called and answered.

use super::*;

impl Workload<'_> {
    pub(super) fn provide(&mut self) {
        let service = self.court.among(&SERVICES);
        let spelling = self.spelled(service);
        self.send(&frame(
            "advertise_service",
            "service",
            &spelling,
            "\"type\":\"x/Y\"",
        ));
        self.me()
            .await_news(format!("advertised service {spelling}"));
        let (provider, changed) = (Some(self.me().who), self.court.turns.get());
        let provided = self.model.services.entry(service.to_owned()).or_default();
        let is_other = provided.provider.is_some_and(|one| Some(one) != provider);
        let is_recent = provided.changed + SETTLED > changed;
        provided.is_contested = is_recent && (is_other || provided.is_contested);
        provided.provider = provider;
        provided.is_confirmed = false;
        provided.changed = changed;
    }

    pub(super) fn withdraw(&mut self) {
        let who = self.me().who;
        let mut services = self.model.services.iter();
        let mine = services.find(|(_, one)| one.provider == Some(who));
        if let Some(service) = mine.map(|(name, _)| name.clone()) {
            // Another client may have become the provider meanwhile.
            self.me().mistakes += 1;
            self.send(&frame("unadvertise_service", "service", &service, ""));
            let changed = self.court.turns.get();
            let provided = crate::model::Provided::none(changed);
            self.model.services.insert(service.clone(), provided);
        }
    }

    pub(super) fn call_out(&mut self) {
        let service = self.court.among(&SERVICES);
        let spelling = self.spelled(service);
        let (number, more) = (self.numbers.next(), self.payload(0));
        let args = format!("{{\"call\":{number},\"more\":{more}}}");
        let (text, timeout) = self.court.among(&[
            ("", DEFAULT_TIMEOUT),
            (",\"timeout\":0.05", Duration::from_millis(50)),
            (",\"timeout\":2", Duration::from_secs(2)),
            (",\"timeout\":86400", DAY),
        ]);
        let id = self.id();
        let more = format!("\"id\":{id}{text},\"args\":{args}");
        self.send(&frame("call_service", "service", &spelling, &more));
        let forward = Forward {
            service: absolute(service),
            args: args.clone(),
            since: Instant::now(),
            turns: self.court.turns.get(),
            timeout,
            answered: None,
            heard_by: None,
            orphaned: None,
        };
        self.model.forwards.insert(number, forward);
        self.court.count("calls to clients");
        let court = self.court;
        self.me().note_call(
            &id,
            &format!("{spelling} {args}"),
            Expect::Forwarded(number),
            false,
            court,
        );
    }

    /// Decides about the calls that this client has received as a provider.
    pub fn answer_calls(&mut self) {
        let who = self.me().who;
        let asked = &mut self.model.asked;
        let asked: Vec<_> = asked.extract_if(.., |one| one.provider == who).collect();
        for one in asked {
            let delay = match self.court.below(5) {
                0 => continue,
                1 => Duration::from_millis(self.court.below(3000) as u64),
                _ => Duration::ZERO,
            };
            let result = self.court.chance(0.9);
            let values = format!("{{\"v\":{}}}", self.payload(1));
            let (id, service) = (one.id, one.service);
            let more = format!("\"id\":{id},\"values\":{values},\"result\":{result}");
            let frame = frame("service_response", "service", &service, &more);
            let due = Instant::now() + delay;
            self.me().due_answers.push((due, one.number, frame));
            if let Some(forward) = self.model.forwards.get_mut(&one.number) {
                forward.answered = Some((due, result, values));
            }
        }
        let now = Instant::now();
        let due = &mut self.me().due_answers;
        let due: Vec<_> = due.extract_if(.., |(due, ..)| *due <= now).collect();
        for (_, number, frame) in due {
            // Its caller may already have received a timeout, or may have disconnected.
            let forward = self.model.forwards.get(&number);
            if forward.is_none_or(|one| one.since + one.timeout <= now) {
                self.model.orphans += 1;
            }
            self.send(&frame);
        }
    }
}
