//! `misfit serve` as a child, and a client that writes its requests byte by byte: it shares nothing with the server.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::rig::program;

/// A server that is ended with the test.
pub struct Served {
    child: Child,
    pub port: u16,
    pub url: String,
    pub token: String,
    /// Name of the first study in addresses.
    pub study: String,
}

/// An answer.
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {} {}", self.head, String::from_utf8_lossy(&self.body)))
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may have been ended by the test.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Served {
    pub fn start(path: &Path, more: &[&str]) -> Served {
        let mut child =
            program().arg("serve").arg(path).args(["--port", "0"]).args(more).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: first line `{line}`"));
        let url = said["url"].as_str().unwrap().to_string();
        let token = url.split("token=").nth(1).unwrap().to_string();
        let port = u16::try_from(said["port"].as_u64().unwrap()).unwrap();
        let mut served = Served { child, port, url, token, study: String::new() };
        // A folder without a study is served too.
        served.study = served.get("/api/studies").json()["studies"][0]["id"].as_str().unwrap_or_default().to_string();
        served
    }

    /// Bytes as they are sent, and the answer until the server closes.
    pub fn raw(&self, bytes: &[u8]) -> Option<Answer> {
        self.raw_within(bytes, Duration::from_secs(60))
    }

    /// The same, as far as it comes within this time: a request that is not whole is waited for.
    pub fn raw_within(&self, bytes: &[u8], time: Duration) -> Option<Answer> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).ok()?;
        stream.set_read_timeout(Some(time)).ok()?;
        // A server that has refused need not read the rest.
        let _ = stream.write_all(bytes);
        let mut all = Vec::new();
        let _ = stream.read_to_end(&mut all);
        let end = all.windows(4).position(|w| w == b"\r\n\r\n")?;
        let head = String::from_utf8_lossy(&all[..end]).into_owned();
        let status = head.split(' ').nth(1)?.parse().ok()?;
        let body = all[end + 4..].to_vec();
        let body = if head.to_lowercase().contains("transfer-encoding: chunked") { unchunked(&body) } else { body };
        Some(Answer { status, head, body })
    }

    pub fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut text = format!("{method} {path} HTTP/1.1\r\nconnection: close\r\ncontent-length: {}\r\n", body.len());
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        self.raw(format!("{text}\r\n{body}").as_bytes()).unwrap_or_else(|| panic!("no answer to {method} {path}"))
    }

    pub fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[("host", &self.host()), ("x-misfit-token", &self.token)], "")
    }

    pub fn post(&self, what: &str, body: &Value) -> Answer {
        self.send(&format!("/api/studies/{}/{what}", self.study), "application/json", &body.to_string())
    }

    /// A body of this type to an address.
    pub fn send(&self, path: &str, kind: &str, body: &str) -> Answer {
        self.request("POST", path, &[("host", &*self.host()), ("x-misfit-token", &self.token), ("content-type", kind)], body)
    }

    pub fn state(&self) -> Value {
        self.get(&format!("/api/studies/{}", self.study)).json()
    }

    /// Begins a job and waits for its end.
    pub fn run(&self, order: &Value) -> Value {
        let begun = self.post("run", order);
        assert_eq!(begun.status, 200, "{}", String::from_utf8_lossy(&begun.body));
        self.wait(&begun.json()["job"])
    }

    pub fn wait(&self, job: &Value) -> Value {
        let until = Instant::now() + Duration::from_secs(300);
        loop {
            let state = self.state();
            let found = state["jobs"].as_array().unwrap().iter().find(|j| j["id"] == *job).unwrap();
            if !found["ended"].is_null() {
                return found["ended"].clone();
            }
            assert!(Instant::now() < until, "{found}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    pub fn compare(&self, model: &str, values: &Value) -> Vec<Value> {
        let answer = self.post("compare", &json!({ "model": model, "values": values, "whole": true }));
        assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
        answer.json()["tests"].as_array().unwrap().clone()
    }

    #[cfg(unix)]
    pub fn signal(&mut self, name: &str) -> Option<i32> {
        let sent = std::process::Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        self.child.wait().unwrap().code()
    }

    /// Resident memory [MB].
    #[cfg(target_os = "linux")]
    pub fn memory(&self) -> f64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = text.lines().find(|l| l.starts_with("VmHWM")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
    }

    pub fn alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }
}

fn unchunked(mut rest: &[u8]) -> Vec<u8> {
    let mut body = vec![];
    while let Some(end) = rest.windows(2).position(|w| w == b"\r\n") {
        let size = usize::from_str_radix(&String::from_utf8_lossy(&rest[..end]), 16).unwrap_or(0);
        if size == 0 || rest.len() < end + 2 + size {
            break;
        }
        body.extend(&rest[end + 2..end + 2 + size]);
        rest = rest.get(end + 4 + size..).unwrap_or(&[]);
    }
    body
}

/// Error of a test in a comparison.
pub fn error(tests: &[Value], id: &str) -> f64 {
    tests.iter().find(|t| t["id"] == id).unwrap()["error"].as_f64().unwrap()
}
