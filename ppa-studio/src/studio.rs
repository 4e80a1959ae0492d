//! A limb, open in the browser.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;

use axum::Router;

use crate::error::StudioError;
use crate::opening::Opening;
use crate::state::State;
use crate::token::Token;

/// A limb, open in the browser. Clones share their state.
#[derive(Clone)]
pub struct Studio(Arc<State>);

impl Studio {
    /// Opens a scan, a case, a plan, a dataset or trainings, and finds what the case says; changes that were saved beside case and plan are taken up again.
    ///
    /// # Errors
    /// [`StudioError`] naming the file at fault.
    pub fn open(opening: &Opening) -> Result<Self, StudioError> {
        Self::open_with(opening, Token::random()?)
    }

    /// The same with the token that the page needs.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(opening: &Opening, token: Token) -> Result<Self, StudioError> {
        Ok(Self(Arc::new(State::open(opening, token)?)))
    }

    /// The address to open in a browser on this machine, with the token that lets it in.
    pub fn address(&self, mut listening: SocketAddr) -> String {
        // Nothing can be asked of "all addresses of this machine".
        if listening.ip().is_unspecified() {
            listening.set_ip(match listening {
                SocketAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
            });
        }
        format!("http://{listening}/?token={}", self.0.token.secret())
    }

    /// Ends the images and the forecast under way, and a run after the poses under way.
    pub(crate) fn stop(&self) {
        self.0.depth.cancel();
        self.0.radiograph.cancel();
        self.0.forecast.stop();
        self.0.training_errors.turn.cancel();
        self.0.generation.finish();
    }

    /// All that the page asks for. It answers only requests with the token or the cookie that the token gives, to localhost or an IP address.
    pub fn router(&self) -> Router {
        crate::routes::router(self.0.clone())
    }
}
