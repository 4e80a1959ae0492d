//! Requests of which only the newest is served, so that no queue builds up behind a slider.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::StudioError;

/// One kind of work, done for one request at a time and only for the newest.
#[derive(Default)]
pub(crate) struct Newest {
    latest: Arc<AtomicU64>,
    turn: Mutex<()>,
}

/// A request for this work. Dropping it does not end the work; [`Ticket::cancel`] does.
#[derive(Clone)]
pub(crate) struct Ticket {
    number: u64,
    latest: Arc<AtomicU64>,
}

impl Newest {
    /// Registers a request; all earlier ones are superseded.
    pub fn enter(&self) -> Ticket {
        Ticket {
            number: self.latest.fetch_add(1, Ordering::SeqCst) + 1,
            latest: self.latest.clone(),
        }
    }

    /// Ends the current work without requesting other work.
    pub fn cancel(&self) {
        self.enter();
    }

    /// Waits for the current work.
    ///
    /// # Errors
    /// [`StudioError::Superseded`] if a later request has arrived.
    pub fn turn(&self, ticket: &Ticket) -> Result<MutexGuard<'_, ()>, StudioError> {
        let turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        if ticket.is_newest() {
            return Ok(turn);
        }
        Err(StudioError::Superseded)
    }
}

impl Ticket {
    pub fn is_newest(&self) -> bool {
        self.latest.load(Ordering::SeqCst) == self.number
    }

    /// Ends this request's work, unless a later request has already done so.
    pub fn cancel(&self) {
        let _ = self.latest.compare_exchange(
            self.number,
            self.number + 1,
            Ordering::SeqCst,
            Ordering::SeqCst,
        );
    }
}

/// Ends the work of a request when nobody waits for its answer any more.
pub(crate) struct CancelOnDrop(pub Ticket);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_newest_request_gets_its_turn() {
        let work = Newest::default();
        let tickets: Vec<Ticket> = (0..1000).map(|_| work.enter()).collect();
        let turns = tickets.iter().filter(|ticket| work.turn(ticket).is_ok());
        assert_eq!(turns.count(), 1);
        assert!(work.turn(&tickets[999]).is_ok());
        work.cancel();
        assert!(work.turn(&tickets[999]).is_err());
    }

    #[test]
    fn a_dropped_request_does_not_end_a_later_one() {
        let work = Newest::default();
        let first = CancelOnDrop(work.enter());
        let second = work.enter();
        drop(first);
        assert!(second.is_newest());
        drop(CancelOnDrop(second.clone()));
        assert!(!second.is_newest());
    }
}
