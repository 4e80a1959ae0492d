//! Access to the page and refused requests.

use axum::body::Body;
use axum::http::StatusCode;

use ppa_studio::{Opening, Studio};

use crate::browser::{Browser, HOST, phantom, request};

#[test]
fn requests_without_the_cookie_or_token_are_refused() {
    let browser = Browser::new();
    for path in ["/", "/?token=0000", "/api/state", "/page/main.js"] {
        let request = request("GET", path, "").header("host", HOST);
        let answer = browser.send(request.body(Body::empty()).unwrap());
        assert_eq!(answer.status, StatusCode::FORBIDDEN, "{path}");
        assert!(answer.text().contains("ppa studio"));
    }
    assert_eq!(browser.get("/").status, StatusCode::OK);
}

#[test]
fn other_hosts_and_other_pages_are_refused() {
    let browser = Browser::new();
    let mut rebound = browser.posting("/api/undo", "{}".to_owned());
    let mut crossed = browser.posting("/api/undo", "{}".to_owned());
    let mut silent = browser.posting("/api/undo", "{}".to_owned());
    let evil = axum::http::HeaderValue::from_static("evil.example:8123");
    rebound.headers_mut().insert("host", evil);
    let evil = axum::http::HeaderValue::from_static("http://evil.example");
    crossed.headers_mut().insert("origin", evil);
    silent.headers_mut().remove("origin");
    for (request, why) in [
        (rebound, "not via another host name"),
        (crossed, "other pages"),
        (silent, "page itself"),
    ] {
        let answer = browser.send(request);
        assert_eq!(answer.status, StatusCode::FORBIDDEN);
        assert!(answer.text().contains(why), "{}", answer.text());
    }
    // A forwarded port may differ from the program's.
    let mut forwarded = browser.posting("/api/undo", "{}".to_owned());
    let headers = forwarded.headers_mut();
    headers.insert(
        "host",
        axum::http::HeaderValue::from_static("localhost:9000"),
    );
    let origin = axum::http::HeaderValue::from_static("http://localhost:9000");
    headers.insert("origin", origin);
    assert_eq!(browser.send(forwarded).status, StatusCode::OK);
}

#[test]
fn ip_addresses_are_hosts_and_other_names_are_not() {
    let browser = Browser::new();
    let status = |host: &'static str| {
        let mut request = browser.posting("/api/undo", "{}".to_owned());
        let headers = request.headers_mut();
        headers.insert("host", axum::http::HeaderValue::from_static(host));
        let origin = format!("http://{host}").parse().unwrap();
        headers.insert("origin", origin);
        browser.send(request).status
    };
    for host in ["192.0.2.7:8123", "[2001:db8::7]:8123", "[::1]", "localhost"] {
        assert_eq!(status(host), StatusCode::OK, "{host}");
    }
    for host in [
        "studio.example:8123",
        "127.0.0.1.example",
        "[evil.example]:8123",
        "2001:db8::7",
        "",
    ] {
        assert_eq!(status(host), StatusCode::FORBIDDEN, "{host}");
    }
}

#[test]
fn the_address_of_all_interfaces_is_one_that_opens() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom(folder.path());
    let studio = Studio::open(&Opening::of(&case)).unwrap();
    let address = |listening: &str| studio.address(listening.parse().unwrap());
    assert!(address("0.0.0.0:8123").starts_with("http://127.0.0.1:8123/?token="));
    assert!(address("[::]:8123").starts_with("http://[::1]:8123/?token="));
    assert!(address("192.0.2.7:8123").starts_with("http://192.0.2.7:8123/?token="));
}

#[test]
fn every_answer_has_the_headers_that_protect_the_page() {
    let browser = Browser::new();
    for path in ["/", "/page/main.js", "/api/state", "/nowhere"] {
        let answer = browser.get(path);
        let policy = answer.headers["content-security-policy"].to_str().unwrap();
        assert!(policy.starts_with("default-src 'none'"));
        assert!(!policy.contains("unsafe"));
        assert_eq!(answer.headers["x-content-type-options"], "nosniff");
        assert_eq!(answer.headers["cache-control"], "no-store");
    }
}

#[test]
fn paths_outside_the_page_and_large_bodies_are_refused() {
    let browser = Browser::new();
    for path in [
        "/page/..%2F..%2FCargo.toml",
        "/page/%2Fetc%2Fpasswd",
        "/etc/passwd",
    ] {
        assert_eq!(browser.get(path).status, StatusCode::NOT_FOUND, "{path}");
    }
    let large = browser.posting("/api/choices", " ".repeat(100_000));
    assert_eq!(browser.send(large).status, StatusCode::PAYLOAD_TOO_LARGE);
    let unknown = browser.posting("/api/depth", r#"{"angel_deg": 3}"#.to_owned());
    let answer = browser.send(unknown);
    assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(answer.text().contains("angel_deg"), "{}", answer.text());
}
