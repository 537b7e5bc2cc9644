//! Who is no reader: other hosts, other pages, no token, paths that lead out, bodies without end, connections that say nothing.

use std::io::Write;
use std::net::TcpStream;
use std::time::Duration;

use serde_json::json;

use super::client::Served;
use crate::rig::Rig;

#[test]
fn without_the_token_nothing_is_told() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    assert!(served.url.starts_with("http://127.0.0.1:") && served.token.len() >= 32, "{}", served.url);
    let host = served.host();
    let (own, token) = (("host", host.as_str()), served.token.as_str());
    let status = |path: &str, headers: &[(&str, &str)]| served.request("GET", path, headers, "").status;
    for path in ["/", "/api/studies", "/page/main.js", "/page/plotly.js", "/no/such"] {
        assert_eq!(status(path, &[own]), 401, "{path}");
        assert_eq!(status(path, &[own, ("x-misfit-token", &token[1..])]), 401, "{path}");
        assert_eq!(status(path, &[("host", "rig.example"), ("x-misfit-token", token)]), 403, "{path}");
        assert_eq!(status(path, &[own, ("x-misfit-token", token), ("origin", "http://rig.example")]), 403, "{path}");
    }
    let first = served.request("GET", &format!("/?token={token}"), &[own], "");
    assert_eq!(first.status, 200);
    let head = first.head.to_lowercase();
    let cookie = head.lines().find_map(|l| l.strip_prefix("set-cookie: ")).unwrap().to_string();
    assert!(cookie.contains("httponly") && cookie.contains("samesite=strict"), "{cookie}");
    assert_eq!(status("/api/studies", &[own, ("cookie", cookie.split(';').next().unwrap())]), 200, "the cookie stands for the token");
    let policy = head.lines().find_map(|l| l.strip_prefix("content-security-policy: ")).unwrap();
    let scripts = policy.split(';').find(|p| p.trim().starts_with("script-src")).unwrap();
    assert_eq!(scripts.trim(), "script-src 'self'");
    assert!(!head.contains("access-control-allow"), "{head}");
    let page = String::from_utf8(first.body).unwrap();
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains(token), "nothing of elsewhere, and no token");
}

#[test]
fn paths_stay_inside_and_bodies_are_bounded() {
    let rig = Rig::new();
    rig.write("secret.txt", "nobody reads this");
    let served = Served::start(rig.folder(), &["--json"]);
    let fit = served.run(&json!({ "verb": "fit", "model": "study" }));
    let run = fit["result"]["model"].as_str().unwrap();
    let file = |name: &str| served.get(&format!("/api/studies/{}/runs/{name}", served.study));
    let report = file(&format!("{run}/report.html"));
    assert_eq!(report.status, 200);
    assert!(report.head.to_lowercase().contains("content-security-policy: sandbox"), "a report is a page of no origin: {}", report.head);
    for bad in [
        "../secret.txt",
        "../../secret.txt",
        "..%2f..%2fsecret.txt",
        &format!("{run}/../../secret.txt"),
        &format!("{run}/..%2f..%2fsecret.txt"),
        &format!("{run}/checkpoint.json"),
        "./study.toml",
        "/etc/passwd",
        "//etc/passwd",
    ] {
        let answer = file(bad);
        assert_eq!(answer.status, 404, "{bad}");
        assert!(!String::from_utf8_lossy(&answer.body).contains("nobody"), "{bad}");
    }
    #[cfg(unix)]
    {
        // A link in a run leads out of it.
        std::fs::remove_file(rig.path("runs").join(run).join("result.json")).unwrap();
        std::os::unix::fs::symlink(rig.path("secret.txt"), rig.path("runs").join(run).join("result.json")).unwrap();
        assert_eq!(file(&format!("{run}/result.json")).status, 404);
    }
    for name in ["../out", "a/b", "", ".hidden", "study", "x\u{0}", "näme", "con fig"] {
        let saved = served.post("save", &json!({ "model": "study", "name": name }));
        assert_eq!(saved.status, 400, "{name}");
    }
    let before: Vec<_> = std::fs::read_dir(rig.folder()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(before.len(), 4, "data, runs, secret, study: {before:?}");
    let long = served.post("compare", &json!({ "model": "x".repeat(300 << 10) }));
    assert_eq!(long.status, 413);
    for (what, body) in
        [("run", json!({ "verb": "rm", "model": "study" })), ("run", json!({ "verb": "fit", "model": "../x" })), ("nothing", json!({}))]
    {
        let answer = served.post(what, &body);
        assert!(answer.status == 400 || answer.status == 404, "{body}");
    }
    assert_eq!(
        served
            .request(
                "DELETE",
                "/api/studies",
                &[("host", &served.host()), ("x-misfit-token", &served.token), ("content-type", "application/json")],
                ""
            )
            .status,
        405
    );
}

/// A generator of its own: what is sent follows from the seed.
struct Chance(u64);

impl Chance {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }
    fn of<'a>(&mut self, all: &[&'a str]) -> &'a str {
        all[self.below(all.len())]
    }
}

/// Requests of a fuzzer; `MISFIT_HOSTILE=10000` sends more of them.
#[test]
fn a_fuzzer_gets_nothing_and_breaks_nothing() {
    let rig = Rig::new();
    rig.write("secret.txt", "nobody reads this");
    let mut served = Served::start(rig.folder(), &["--json"]);
    let own = rig.read("study.toml");
    let host = served.host();
    let study = served.study.clone();
    // Connections that never ask stand beside all others.
    let half: Vec<TcpStream> = (0..100)
        .map(|k| {
            let mut stream = TcpStream::connect(("127.0.0.1", served.port)).unwrap();
            let begun: &[u8] = [&b"GET / HTTP/1.1\r\nhost: "[..], b"POST", b"\x16\x03\x01", b""][k % 4];
            stream.write_all(begun).unwrap();
            stream
        })
        .collect();
    let count = std::env::var("MISFIT_HOSTILE").ok().and_then(|n| n.parse().ok()).unwrap_or(2000usize);
    let (mut chance, mut counted) = (Chance(7), std::collections::BTreeMap::new());
    for k in 0..count {
        let method = chance.of(&["GET", "POST", "PUT", "DELETE", "OPTIONS", "TRACE", "HEAD", "CONNECT", "GET", "POST", "\u{0}", "get"]);
        let name =
            chance.of(&["study", "..", "%2e%2e", "%00", "*", "a b", "<script>", "runs", "20261124-112100-fit", "secret.txt", "\\..\\"]);
        let path = match chance.below(8) {
            0 => format!("/api/studies/{study}/runs/../{name}"),
            1 => format!("/api/studies/{name}"),
            2 => format!("/api/studies/{study}/{}", chance.of(&["run", "save", "open", "compare", "stop", "events/..", "models/../.."])),
            3 => format!("/page/{name}"),
            4 => format!("//{name}/..//secret.txt"),
            5 => format!("http://evil.example/{name}"),
            6 => "/".repeat(1 + chance.below(3000)),
            _ => format!("/../../../../{name}"),
        };
        let with_host = chance.of(&[&host, "evil.example", "localhost", "127.0.0.1:1", "", "[::1", "127.0.0.1:99999999"]);
        let token = chance.of(&["", "0", &served.token[1..], "' or 1=1", "\u{7f}"]).to_string();
        // One in three knows the token and is hostile all the same; it asks only for what changes nothing.
        let knows = chance.below(3) == 0;
        let body = match chance.below(6) {
            0 => "{".repeat(1 + chance.below(5000)),
            1 => format!("{{\"model\":\"{name}\",\"name\":\"../{name}\"}}"),
            2 => "{\"model\":\"study\",\"values\":{\"0.0\":1e999}}".into(),
            3 => format!("{{\"model\":\"study\",\"values\":{{\"{}.{}\":-1}}}}", chance.below(99), chance.below(99)),
            4 => "\u{0}\u{1}\u{2}".into(),
            _ => String::new(),
        };
        let length = if chance.below(5) == 0 { body.len() + chance.below(3) } else { body.len() };
        let mut text = format!("{method} {path} HTTP/1.{}\r\nhost: {with_host}\r\nconnection: close\r\n", chance.below(2));
        text += &format!(
            "content-length: {length}\r\ncontent-type: {}\r\n",
            chance.of(&["application/json", "text/plain", "multipart/form-data"])
        );
        text += &format!("x-misfit-token: {}\r\n", if knows { &served.token } else { &token });
        if chance.below(3) == 0 {
            text += &format!("origin: {}\r\n", chance.of(&["null", "http://evil.example", "file://", "http://127.0.0.1:1"]));
        }
        text += &format!("\r\n{body}");
        let mut bytes = text.into_bytes();
        if chance.below(4) == 0 {
            let at = chance.below(bytes.len());
            bytes[at] = chance.below(256) as u8;
        }
        if length > body.len() || chance.below(10) == 0 {
            // What is cut off is not waited for.
            let cut = chance.below(bytes.len());
            if let Ok(mut stream) = TcpStream::connect(("127.0.0.1", served.port)) {
                let _ = stream.write_all(&bytes[..cut]);
            }
            continue;
        }
        let Some(answer) = served.raw_within(&bytes, Duration::from_millis(400)) else { continue };
        *counted.entry(answer.status).or_insert(0) += 1;
        let said = String::from_utf8_lossy(&answer.body);
        assert!(!said.contains("nobody reads"), "{k}: {}", String::from_utf8_lossy(&bytes));
        assert!(answer.status < 500, "{k}: {} {}", answer.status, String::from_utf8_lossy(&bytes));
        assert!(answer.status >= 400 || (knows && with_host == host), "{k}: {} to {}", answer.status, String::from_utf8_lossy(&bytes));
    }
    assert!(served.alive(), "the server fell");
    assert_eq!(served.get("/api/studies").status, 200, "and answers beside {} connections that never asked", half.len());
    assert_eq!((rig.read("study.toml"), rig.runs().len()), (own, 0), "nothing was written");
    assert_eq!(std::fs::read_dir(rig.folder()).unwrap().count(), 3, "data, secret, study");
    println!("{count} hostile requests: {counted:?}");
}
