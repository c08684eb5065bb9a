//! A bounded list of what was set aside: the first are listed one by one, the rest are counted.

use tilefold_schemas::SetAside;
use tilefold_schemas::limits::MAX_SET_ASIDE_LISTED;

/// Collects set-asides without growing with the damage.
#[derive(Debug, Default)]
pub(crate) struct Losses {
    listed: Vec<SetAside>,
    counted: Vec<SetAside>,
}

impl Losses {
    /// Lists `loss`, or adds it to the count of its kind and topic when the list is full.
    pub(crate) fn push(&mut self, loss: SetAside) {
        if self.listed.len() < MAX_SET_ASIDE_LISTED {
            self.listed.push(loss);
            return;
        }
        let alike = |other: &&mut SetAside| other.kind == loss.kind && other.topic == loss.topic;
        match self.counted.iter_mut().find(alike) {
            Some(counted) => counted.count = counted.count.saturating_add(loss.count),
            None => self.counted.push(SetAside {
                reason: format!("not listed one by one; the first of them: {}", loss.reason),
                ..loss
            }),
        }
    }

    /// Lists a loss, if there is one.
    pub(crate) fn extend(&mut self, loss: Option<SetAside>) {
        if let Some(loss) = loss {
            self.push(loss);
        }
    }

    /// The list, then the counts.
    pub(crate) fn into_list(mut self) -> Vec<SetAside> {
        self.listed.append(&mut self.counted);
        self.listed
    }
}
