//! The studio that a browser shows.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;

use axum::Router;

use crate::error::StudioError;
use crate::opening::Opening;
use crate::state::State;
use crate::token::Token;

/// A studio, shown in the browser. Clones share their state.
#[derive(Clone)]
pub struct Studio(Arc<State>);

impl Studio {
    /// Opens a scan, case, plan, dataset or training runs, prepares the limb, and restores the changes saved next to case and plan.
    ///
    /// # Errors
    /// [`StudioError`] naming the file at fault.
    pub fn open(opening: &Opening) -> Result<Self, StudioError> {
        Self::open_with(opening, Token::random()?)
    }

    /// The same as [`Self::open`], with a given token for the page.
    ///
    /// # Errors
    /// The same as [`Self::open`].
    pub fn open_with(opening: &Opening, token: Token) -> Result<Self, StudioError> {
        Ok(Self(Arc::new(State::open(opening, token)?)))
    }

    /// Returns the address to open in a browser on this machine, including the token.
    pub fn address(&self, mut listening: SocketAddr) -> String {
        // A browser cannot connect to the unspecified address.
        if listening.ip().is_unspecified() {
            listening.set_ip(match listening {
                SocketAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
            });
        }
        format!("http://{listening}/?token={}", self.0.token.secret())
    }

    /// Cancels running images, forecasts and training errors, and ends a generation after its current poses.
    pub(crate) fn stop(&self) {
        self.0.depth.cancel();
        self.0.radiograph.cancel();
        self.0.forecast.stop();
        self.0.training_errors.turn.cancel();
        self.0.generation.finish();
    }

    /// Returns the router for the page. It answers only requests with the token or its cookie, to localhost or an IP address.
    pub fn router(&self) -> Router {
        crate::routes::router(self.0.clone())
    }
}
