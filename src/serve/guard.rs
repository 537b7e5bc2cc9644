//! Who may ask: the token, the name the server is called by, and the page the question comes from.
//!
//! A page of another site that the reader has open can make the browser ask this server. It does not know the token, its `Origin` and
//! `Sec-Fetch-Site` give it away, and a name that it has made resolve to this machine (DNS rebinding) is no address.

use std::net::IpAddr;

use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, StatusCode, header};
use rand::RngCore;

/// Header in which a program may send the token.
pub const HEADER: &str = "x-misfit-token";

/// Addresses whose bodies are files.
const FILES: &str = "/api/files/";

/// What is checked of every request.
pub struct Guard {
    token: String,
    port: u16,
    listen: IpAddr,
}

impl Guard {
    /// With a random token of 128 bits.
    pub fn new(listen: IpAddr, port: u16) -> Guard {
        let mut bytes = [0u8; 16];
        rand::rng().fill_bytes(&mut bytes);
        Guard { token: bytes.iter().map(|b| format!("{b:02x}")).collect(), port, listen }
    }

    /// The address to open.
    pub fn url(&self) -> String {
        let host = match self.listen {
            ip if ip.is_unspecified() => "127.0.0.1".to_string(),
            IpAddr::V6(ip) => format!("[{ip}]"),
            ip => ip.to_string(),
        };
        format!("http://{host}:{}/?token={}", self.port, self.token)
    }

    /// The cookie that stands for the token from then on. Cookies know no ports, so its name holds the port.
    pub fn cookie(&self) -> String {
        format!("misfit-{}={}; Path=/; HttpOnly; SameSite=Strict", self.port, self.token)
    }

    /// Whether the first page is asked for with the token in its address.
    pub fn opens(&self, parts: &Parts) -> bool {
        let given = parts.uri.query().and_then(|q| q.split('&').find_map(|p| p.strip_prefix("token=")));
        parts.method == Method::GET && parts.uri.path() == "/" && given.is_some_and(|t| same(t, &self.token))
    }

    /// Why a request is refused.
    pub fn refuses(&self, parts: &Parts) -> Option<(StatusCode, &'static str)> {
        let headers = &parts.headers;
        let host = one(headers, "host");
        if !host.is_some_and(|h| self.names(h)) || parts.uri.authority().is_some_and(|a| !self.names(a.as_str())) {
            return Some((StatusCode::FORBIDDEN, "the request names another host"));
        }
        if headers.contains_key(header::ORIGIN) && !one(headers, "origin").is_some_and(|o| self.own(o)) {
            return Some((StatusCode::FORBIDDEN, "the request comes from another page"));
        }
        let opens = self.opens(parts);
        let site = headers.get("sec-fetch-site").map(|s| s.as_bytes());
        if site.is_some_and(|s| s != b"same-origin" && s != b"none") && !opens {
            return Some((StatusCode::FORBIDDEN, "the request comes from another page"));
        }
        let sent = one(headers, HEADER).is_some_and(|t| same(t, &self.token));
        if !(opens || sent || self.has_cookie(headers)) {
            return Some((StatusCode::UNAUTHORIZED, "the token is missing: open the address that `misfit serve` has printed"));
        }
        // What changes something is asked by the page itself, or by a program that knows the token.
        if parts.method != Method::GET {
            if !(sent || headers.contains_key(header::ORIGIN)) {
                return Some((StatusCode::FORBIDDEN, "the request says neither its page nor the token in a header"));
            }
            // Both are types that no form of another page can send without asking first.
            let kind = if parts.uri.path().starts_with(FILES) { "application/octet-stream" } else { "application/json" };
            if one(headers, "content-type").is_none_or(|t| t != kind) {
                return Some((
                    StatusCode::UNSUPPORTED_MEDIA_TYPE,
                    "the body is neither application/json nor, of a file, application/octet-stream",
                ));
            }
        }
        None
    }

    /// `host:port` as this server is called: an address it listens at, or `localhost`.
    fn names(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        if port.parse::<u16>().ok() != Some(self.port) {
            return false;
        }
        let ip = name.strip_prefix('[').and_then(|n| n.strip_suffix(']')).unwrap_or(name).parse::<IpAddr>();
        match ip {
            Ok(ip) => ip.is_loopback() || (!self.listen.is_loopback() && (ip == self.listen || self.listen.is_unspecified())),
            Err(_) => name == "localhost",
        }
    }

    fn own(&self, origin: &str) -> bool {
        origin.strip_prefix("http://").is_some_and(|host| self.names(host))
    }

    fn has_cookie(&self, headers: &HeaderMap) -> bool {
        let name = format!("misfit-{}=", self.port);
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|v| v.to_str().ok()).flat_map(|v| v.split(';'));
        cookies.filter_map(|c| c.trim().strip_prefix(&name)).any(|t| same(t, &self.token))
    }
}

/// A header that stands there once.
fn one<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let mut all = headers.get_all(name).iter();
    let first = all.next()?;
    if all.next().is_some() { None } else { first.to_str().ok() }
}

/// Whether two texts are the same, in a time that does not say where they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::Request;

    fn asked(guard: &Guard, method: &str, uri: &str, headers: &[(&str, &str)]) -> Option<u16> {
        let mut request = Request::builder().method(method).uri(uri);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let (parts, ()) = request.body(()).unwrap().into_parts();
        guard.refuses(&parts).map(|r| r.0.as_u16())
    }

    #[test]
    fn only_the_page_itself_and_who_knows_the_token() {
        let guard = Guard::new("127.0.0.1".parse().unwrap(), 8000);
        let token = guard.token.clone();
        let host = ("host", "127.0.0.1:8000");
        let known = (HEADER, token.as_str());
        let cookie = format!("a=b; misfit-8000={token}");
        assert_eq!(token.len(), 32);
        assert_eq!(asked(&guard, "GET", "/api", &[host, known]), None);
        assert_eq!(asked(&guard, "GET", "/api", &[host, ("cookie", &cookie)]), None);
        assert_eq!(asked(&guard, "GET", &format!("/?token={token}"), &[("host", "localhost:8000")]), None);
        assert_eq!(asked(&guard, "GET", &format!("/api?token={token}"), &[host]), Some(401), "the address opens the page alone");
        assert_eq!(asked(&guard, "GET", "/api", &[host]), Some(401));
        assert_eq!(asked(&guard, "GET", "/api", &[host, (HEADER, &token[1..])]), Some(401));
        for bad in ["evil.example:8000", "127.0.0.1", "127.0.0.1:80", "10.0.0.1:8000", "127.0.0.1.evil.example:8000", "localhost.:8000"] {
            assert_eq!(asked(&guard, "GET", "/api", &[("host", bad), known]), Some(403), "{bad}");
        }
        assert_eq!(asked(&guard, "GET", "/api", &[host, host, known]), Some(403), "two hosts");
        assert_eq!(asked(&guard, "GET", "http://evil.example:8000/api", &[host, known]), Some(403));
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8000", "http://127.0.0.1:8001", "http://127.0.0.1:8000@evil"] {
            assert_eq!(asked(&guard, "GET", "/api", &[host, known, ("origin", origin)]), Some(403), "{origin}");
        }
        let json = ("content-type", "application/json");
        let own = ("origin", "http://127.0.0.1:8000");
        assert_eq!(asked(&guard, "POST", "/api", &[host, ("cookie", &cookie), json]), Some(403), "a form of another page");
        assert_eq!(asked(&guard, "POST", "/api", &[host, ("cookie", &cookie), json, own]), None);
        assert_eq!(asked(&guard, "POST", "/api", &[host, known, ("content-type", "text/plain")]), Some(415));
        let file = ("content-type", "application/octet-stream");
        assert_eq!(asked(&guard, "POST", "/api/files/1/0", &[host, known, file]), None);
        assert_eq!(asked(&guard, "POST", "/api/files/1/0", &[host, ("cookie", &cookie), file]), Some(403), "a form of another page");
        assert_eq!(asked(&guard, "POST", "/api/files/1/0", &[host, known, json]), Some(415));
        assert_eq!(asked(&guard, "POST", "/api", &[host, known, file]), Some(415), "an order is JSON");
        assert_eq!(asked(&guard, "GET", "/api", &[host, known, ("sec-fetch-site", "cross-site")]), Some(403));
    }

    #[test]
    fn every_address_is_named_where_it_listens_at_all() {
        let guard = Guard::new("0.0.0.0".parse().unwrap(), 80);
        assert!(guard.names("10.1.2.3:80") && guard.names("[::1]:80") && !guard.names("rig.local:80"));
        assert!(guard.url().starts_with("http://127.0.0.1:80/?token="));
    }
}
