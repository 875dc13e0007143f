//! The fields of a client's request by their names, read by a second reader.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;

use crate::json::Json;

/// The fields of a request, read once more.
pub(super) struct Named {
    pub(super) service: Service,
    json: Option<Json>,
    /// Whether they were taken at all.
    pub(super) is_whole: bool,
}

impl Named {
    pub(super) fn read(service: Service, arguments: &Arguments) -> Self {
        let json = Json::read(arguments.payload().raw().get());
        let is_whole = match (&json, arguments) {
            (Some(Json::Array(entries)), Arguments::Positional(_)) => {
                entries.len() <= service.fields().len()
            }
            (Some(Json::Object(_)), Arguments::Object(_)) => true,
            _ => false,
        };
        Self {
            service,
            json,
            is_whole,
        }
    }

    fn get(&self, name: &str) -> Option<&Json> {
        match self.json.as_ref().filter(|_| self.is_whole)? {
            Json::Array(entries) => {
                let index = self
                    .service
                    .fields()
                    .iter()
                    .position(|field| field.name == name)?;
                entries.get(index)
            }
            object => object.get(name),
        }
    }

    pub(super) fn number(&self, name: &str, is_good: impl Fn(f64) -> bool) -> Option<f64> {
        self.get(name)?
            .number()
            .filter(|value| value.is_finite() && is_good(*value))
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.get(name)?.text().map(str::to_owned)
    }

    pub(super) fn boolean(&self, name: &str) -> Option<bool> {
        match self.get(name)? {
            Json::Boolean(value) => Some(*value),
            _ => None,
        }
    }

    pub(super) fn joints<const N: usize>(
        &self,
        name: &str,
        is_good: impl Fn(f64) -> bool,
    ) -> Option<[f64; N]> {
        let Json::Array(entries) = self.get(name)? else {
            return None;
        };
        let numbers = entries.iter().map(Json::number);
        let numbers: Option<Vec<f64>> = numbers
            .map(|one| one.filter(|one| one.is_finite() && is_good(*one)))
            .collect();
        numbers?.try_into().ok()
    }
}
