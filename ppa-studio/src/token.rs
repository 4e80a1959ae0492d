//! The secret in the address of the page.

use std::fmt;

use crate::error::StudioError;

/// A random number that only the person who started the program knows.
pub(crate) struct Token {
    secret: String,
    /// Name of the cookie: cookies of all ports of a host are sent to each of them, so every studio has its own.
    cookie: String,
}

impl Token {
    pub fn random() -> Result<Self, StudioError> {
        let mut bytes = [0; 20];
        getrandom::fill(&mut bytes).map_err(StudioError::Random)?;
        let digits = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let (name, secret) = bytes.split_at(4);
        let name: String = digits(name);
        Ok(Self {
            secret: digits(secret),
            cookie: format!("ppa_studio_{name}"),
        })
    }

    /// Name of the cookie that holds it.
    pub fn cookie(&self) -> &str {
        &self.cookie
    }

    /// Compared in the same time wherever the first difference is.
    pub fn is(&self, given: &str) -> bool {
        let pairs = self.secret.bytes().zip(given.bytes());
        let differences = pairs.fold(0, |all, (a, b)| all | (a ^ b));
        self.secret.len() == given.len() && differences == 0
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.secret)
    }
}
