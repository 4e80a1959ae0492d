//! The secret in the address of the page.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::StudioError;

/// Number of leading digits that name the cookie; the rest is the secret.
const NAME_DIGITS: usize = 8;
const DIGITS: usize = 40;

/// A random number known only to the user who started the program: the name of a cookie and its secret value.
///
/// Browsers send the cookies of a host to all its ports, so every studio has its own cookie name.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Token(String);

impl Token {
    /// # Errors
    /// [`StudioError::Random`] if the system provides no random numbers.
    pub fn random() -> Result<Self, StudioError> {
        let mut bytes = [0; DIGITS / 2];
        getrandom::fill(&mut bytes).map_err(StudioError::Random)?;
        Ok(Self(
            bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
        ))
    }

    /// Returns the name of the cookie that holds the token.
    pub(crate) fn cookie(&self) -> String {
        format!("ppa_studio_{}", &self.0[..NAME_DIGITS])
    }

    pub(crate) fn secret(&self) -> &str {
        &self.0[NAME_DIGITS..]
    }

    /// Compares the secret in constant time.
    pub(crate) fn is(&self, given: &str) -> bool {
        let secret = self.secret();
        let pairs = secret.bytes().zip(given.bytes());
        let differences = pairs.fold(0, |all, (a, b)| all | (a ^ b));
        secret.len() == given.len() && differences == 0
    }
}

/// Omits the secret.
impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({})", self.cookie())
    }
}

impl TryFrom<String> for Token {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, &'static str> {
        let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        match text.len() == DIGITS && text.bytes().all(is_digit) {
            true => Ok(Self(text)),
            false => Err("a token has 40 hexadecimal digits"),
        }
    }
}

impl From<Token> for String {
    fn from(token: Token) -> Self {
        token.0
    }
}
