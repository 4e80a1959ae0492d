//! Access control: only browsers that know the token may use the page, via localhost or an IP address, from the page itself.

use std::net::{Ipv4Addr, Ipv6Addr};
use std::sync::Arc;
use std::time::UNIX_EPOCH;

use axum::body::Body;
use axum::extract::{Request, State as Extracted};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, COOKIE, HOST, HeaderName, LOCATION, ORIGIN,
    REFERRER_POLICY, SET_COOKIE, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::state::State;
use crate::token::Token;

/// Content security policy: the page may load only what this program serves, no inline script or style.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const HEADERS: [(HeaderName, &str); 4] = [
    (CONTENT_SECURITY_POLICY, POLICY),
    (X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (REFERRER_POLICY, "no-referrer"),
    (CACHE_CONTROL, "no-store"),
];

/// Header that tells a page that the program has restarted.
const STARTED: HeaderName = HeaderName::from_static("x-started");

/// Refuses unauthorised requests, exchanges the token for a cookie, and adds the headers that protect the page.
pub(crate) async fn guard(
    Extracted(state): Extracted<Arc<State>>,
    request: Request,
    next: Next,
) -> Response {
    let mut response = match judged(&state.token, &request) {
        Judged::Known => {
            let mut answer = next.run(request).await;
            answer.headers_mut().insert(STARTED, start(&state));
            answer
        }
        Judged::Enters => admit(&state.token),
        Judged::Refused(why) => (StatusCode::FORBIDDEN, why).into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Returns the start time of the program in nanoseconds, which identifies the start.
fn start(state: &State) -> HeaderValue {
    let since = state.started.duration_since(UNIX_EPOCH);
    HeaderValue::from(since.unwrap_or_default().as_nanos() as u64)
}

/// The sender of a request.
enum Judged {
    /// A browser with the cookie.
    Known,
    /// A browser that opens the address including the token.
    Enters,
    /// Anybody else, with the reason for the refusal.
    Refused(&'static str),
}

fn judged(token: &Token, request: &Request) -> Judged {
    let headers = request.headers();
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    // A host name that resolves to this machine may belong to another party's page (DNS rebinding).
    let host = text(HOST).unwrap_or_default();
    if !is_localhost_or_ip(host) {
        return Judged::Refused(
            "open this page via localhost or an IP address, not via another host name",
        );
    }
    if text(ORIGIN).is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) {
        return Judged::Refused("requests from other pages are refused");
    }
    if *request.method() != Method::GET && text(ORIGIN).is_none() {
        return Judged::Refused("a change must come from the page itself");
    }
    if has_cookie(headers, token) {
        return Judged::Known;
    }
    let given = request.uri().query().and_then(|q| q.strip_prefix("token="));
    if request.uri().path() == "/" && given.is_some_and(|given| token.is(given)) {
        return Judged::Enters;
    }
    Judged::Refused(
        "the address must include its token: open the address that `ppa studio` printed",
    )
}

/// Whether a Host header is localhost or an IP address, which no other party's name server resolves; the port may be a forwarded one.
fn is_localhost_or_ip(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name
        .strip_prefix('[')
        .and_then(|name| name.strip_suffix(']'));
    match bare {
        Some(name) => name.parse::<Ipv6Addr>().is_ok(),
        None => name == "localhost" || name.parse::<Ipv4Addr>().is_ok(),
    }
}

fn has_cookie(headers: &HeaderMap, token: &Token) -> bool {
    let (texts, name) = (headers.get_all(COOKIE).iter(), token.cookie());
    texts
        .filter_map(|value| value.to_str().ok())
        .flat_map(|text| text.split(';'))
        .filter_map(|cookie| cookie.trim().split_once('='))
        .any(|(key, value)| key == name && token.is(value))
}

/// Sets the cookie and redirects to the address without the token.
fn admit(token: &Token) -> Response {
    let cookie = format!(
        "{}={}; HttpOnly; SameSite=Strict; Path=/",
        token.cookie(),
        token.secret()
    );
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::SEE_OTHER;
    let headers = response.headers_mut();
    headers.insert(LOCATION, HeaderValue::from_static("/"));
    let value = HeaderValue::from_str(&cookie).expect("hexadecimal digits");
    headers.insert(SET_COOKIE, value);
    response
}
