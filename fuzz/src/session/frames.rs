//! The frames of an action, recorded if they require an answer.

use super::*;

impl Session {
    /// Pieces of a frame, in order, as frames of their own.
    pub(super) fn send_pieces(&mut self, client: u8, style: u8, size: usize, frame: &str) {
        self.messages += 1;
        let id = self.messages;
        let characters: Vec<char> = frame.chars().collect();
        let pieces = characters.chunks(size);
        let total = pieces.len();
        for (num, piece) in pieces.enumerate() {
            let data = quoted(&piece.iter().collect::<String>());
            let piece = format!(
                "{{\"op\":\"fragment\",\"id\":\"piece-{id}\",\"data\":{data},\"num\":{num},\"total\":{total}}}"
            );
            self.player(client).client.send(&piece, style);
        }
    }

    /// Any bytes, up to the end of a line or message. Later input is read normally.
    pub(super) fn send_garbage(&mut self, client: u8, bytes: &[u8]) {
        let framing = self.framing;
        let player = self.player(client);
        let text = String::from_utf8_lossy(bytes);
        // It may change statuses, fragments or calls in ways that the model does not predict.
        let meddles = ["call", "fragment", "piece", "\\u"]
            .iter()
            .any(|word| text.contains(word));
        player.is_excused |= meddles;
        player.note_forgery(bytes);
        match framing {
            Framing::Lines => player.client.send_bytes([bytes, b"\n"].concat()),
            Framing::WebSocket => {
                let mut message = Vec::new();
                let kind = websocket::opcode::BINARY;
                websocket::append_message(&mut message, kind, [1, 2, 3, 4], 0, bytes);
                player.client.send_bytes(message);
            }
        }
    }

    /// The text of a frame, recorded if it requires an answer.
    pub(super) fn frame(&mut self, client: u8, deed: &Deed<'_>) -> Option<String> {
        Some(match deed {
            Deed::Advertise { topic } => {
                format!("{{\"op\":\"advertise\",\"topic\":{}}}", topic_of(*topic))
            }
            Deed::Unadvertise { topic } => {
                format!("{{\"op\":\"unadvertise\",\"topic\":{}}}", topic_of(*topic))
            }
            Deed::Publish { topic, payload } => {
                let more = payload.json().unwrap_or("0".to_owned());
                self.message(client, TOPICS[usize::from(*topic) % TOPICS.len()], &more)
            }
            Deed::Subscribe {
                topic,
                id,
                throttle_ms,
                queue_length,
                compression,
                size,
            } => {
                let mut frame = format!(
                    "{{\"op\":\"subscribe\",\"topic\":{},\"queue_length\":{queue_length}",
                    topic_of(*topic)
                );
                let compression =
                    ["none", "png", "cbor", "cbor-raw"][usize::from(*compression) % 4];
                put(&mut frame, "id", id.as_ref());
                put(&mut frame, "throttle_rate", throttle_ms.as_ref());
                put(&mut frame, "fragment_size", size.as_ref());
                put(&mut frame, "compression", Some(&quoted(compression)));
                frame + "}"
            }
            Deed::Unsubscribe { topic, id } => {
                let mut frame = format!("{{\"op\":\"unsubscribe\",\"topic\":{}", topic_of(*topic));
                put(&mut frame, "id", id.as_ref());
                frame + "}"
            }
            Deed::Provide { service } => format!(
                "{{\"op\":\"advertise_service\",\"service\":{}}}",
                service_of(*service)
            ),
            Deed::Withdraw { service } => format!(
                "{{\"op\":\"unadvertise_service\",\"service\":{}}}",
                service_of(*service)
            ),
            Deed::Call {
                service,
                timeout,
                args,
            } => self.call(client, *service, *timeout, args),
            Deed::Respond {
                which,
                result,
                values,
            } => {
                let forwarded = &mut self.player(client).forwarded;
                if forwarded.is_empty() {
                    return None;
                }
                let call = forwarded.remove(usize::from(*which) % forwarded.len());
                self.response(&call, *result, values.json().as_deref().unwrap_or("{}"))
            }
            Deed::Level(level) => {
                let level = ["info", "warning", "error", "none", "loud"][usize::from(*level) % 5];
                format!("{{\"op\":\"set_level\",\"level\":\"{level}\"}}")
            }
            Deed::Goal { id, args } => {
                let args = args.json().unwrap_or("{}".to_owned());
                format!(
                    "{{\"op\":\"send_action_goal\",\"action\":\"/ik_action\",\"id\":{id},\"args\":{args},\"feedback\":true}}"
                )
            }
            Deed::Cancel { id } => {
                format!("{{\"op\":\"cancel_action_goal\",\"action\":\"/ik_action\",\"id\":{id}}}")
            }
        })
    }

    /// A message of a client, recorded.
    pub(super) fn message(&mut self, client: u8, topic: &str, more: &str) -> String {
        self.messages += 1;
        let number = self.messages;
        let from = u64::from(client) % CLIENTS as u64;
        self.book.borrow_mut().publish(number, from, topic, more);
        let topic = quoted(topic);
        format!(
            "{{\"op\":\"publish\",\"topic\":{topic},\"msg\":{{\"from\":{from},\"number\":{number},\"more\":{more}}}}}"
        )
    }

    pub(super) fn call(
        &mut self,
        client: u8,
        service: u8,
        timeout: Option<u16>,
        args: &Payload<'_>,
    ) -> String {
        self.calls += 1;
        let id = format!("{ID}{}", self.calls);
        self.player(client).answered.insert(id.clone(), 0);
        let mut frame = format!(
            "{{\"op\":\"call_service\",\"service\":{},\"id\":\"{id}\"",
            service_of(service)
        );
        let timeout = if self.has_arm {
            Some(timeout.unwrap_or_default() % ARM_WAIT)
        } else {
            timeout
        };
        // 0 would mean none, and a call of a silent provider would wait for a day.
        let seconds = timeout.map(|ms| f64::from(ms.max(1)) / 1000.0);
        put(&mut frame, "timeout", seconds.as_ref());
        let args = match args {
            Payload::Fitting(numbers, more) => Some(fitting(service_name(service), numbers, *more)),
            args => args.json(),
        };
        let args = if Service::from_name(service_name(service)).is_some() {
            args
        } else {
            let more = args.unwrap_or("0".to_owned());
            self.book.borrow_mut().call(&id, &more);
            Some(format!("{{\"call\":\"{id}\",\"more\":{more}}}"))
        };
        put(&mut frame, "args", args.as_ref());
        frame + "}"
    }

    /// A provider's answer to a call, recorded.
    pub(super) fn response(
        &self,
        call: &(String, String, String),
        result: bool,
        more: &str,
    ) -> String {
        let (id, service, caller) = call;
        self.book.borrow_mut().answer(caller, result, more);
        let (id, service, caller) = (quoted(id), quoted(service), quoted(caller));
        format!(
            "{{\"op\":\"service_response\",\"service\":{service},\"id\":{id},\"values\":{{\"call\":{caller},\"more\":{more}}},\"result\":{result}}}"
        )
    }
}
