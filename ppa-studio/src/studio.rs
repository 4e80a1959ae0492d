//! A limb, open in the browser.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;

use crate::error::StudioError;
use crate::opening::Opening;
use crate::state::State;

/// A limb, open in the browser. Clones share their state.
#[derive(Clone)]
pub struct Studio(Arc<State>);

impl Studio {
    /// Opens a scan, a case, a plan, a dataset or trainings, and finds what the case says; changes that were saved beside case and plan are taken up again.
    ///
    /// # Errors
    /// [`StudioError`] naming the file at fault.
    pub fn open(opening: &Opening) -> Result<Self, StudioError> {
        Ok(Self(Arc::new(State::open(opening)?)))
    }

    /// The address to open in a browser, with the token that lets it in.
    pub fn address(&self, listening: SocketAddr) -> String {
        format!("http://{listening}/?token={}", self.0.token)
    }

    /// Ends the images and the forecast under way, and a run after the poses under way.
    pub(crate) fn stop(&self) {
        self.0.depth.cancel();
        self.0.radiograph.cancel();
        self.0.forecast.stop();
        self.0.training_errors.turn.cancel();
        self.0.generation.finish();
    }

    /// All that the page asks for. It answers only requests with the token or the cookie that the token gives, to a loopback host.
    pub fn router(&self) -> Router {
        crate::routes::router(self.0.clone())
    }
}
