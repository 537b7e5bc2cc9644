//! Chromium without a window, spoken to by its DevTools protocol (<https://chromedevtools.github.io/devtools-protocol/>).

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// A browser with one page.
pub struct Browser {
    child: Child,
    stream: BufReader<TcpStream>,
    session: String,
    next: u64,
    _folder: tempfile::TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The browser of this machine, by one of its names.
fn program() -> Option<&'static str> {
    let runs =
        |name: &&str| Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success());
    ["chromium", "chromium-browser", "google-chrome", "chrome"].into_iter().find(runs)
}

impl Browser {
    /// None, said in one line, where there is no Chromium.
    pub fn start(width: u32, height: u32) -> Option<Browser> {
        let Some(program) = program() else {
            // What the macros print is kept back by the test runner where the test passes.
            static SAID: std::sync::Once = std::sync::Once::new();
            SAID.call_once(|| drop(writeln!(std::io::stderr(), "no Chromium is found: the page of the workbench is not driven")));
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        let child = Command::new(program)
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
                "--disable-background-networking",
                "--remote-debugging-port=0",
            ])
            .arg(format!("--window-size={width},{height}"))
            .arg(format!("--user-data-dir={}", folder.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let file = folder.path().join("DevToolsActivePort");
        let until = Instant::now() + Duration::from_secs(60);
        let (port, path) = loop {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            if let Some((port, path)) = text.trim().split_once('\n') {
                break (port.parse::<u16>().unwrap(), path.to_string());
            }
            assert!(Instant::now() < until, "{program} does not open its port");
            std::thread::sleep(Duration::from_millis(50));
        };
        let mut stream = BufReader::new(TcpStream::connect(("127.0.0.1", port)).unwrap());
        stream.get_ref().set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let key = "AAAAAAAAAAAAAAAAAAAAAA==";
        let ask = format!(
            "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        );
        stream.get_mut().write_all(ask.as_bytes()).unwrap();
        let mut line = String::new();
        while line != "\r\n" {
            line.clear();
            assert!(stream.read_line(&mut line).unwrap() > 0, "no WebSocket");
        }
        let mut browser = Browser { child, stream, session: String::new(), next: 0, _folder: folder };
        let page = browser.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let session = browser.call("Target.attachToTarget", json!({ "targetId": page, "flatten": true }));
        browser.session = session["sessionId"].as_str().unwrap().to_string();
        for domain in ["Page", "Runtime", "Network", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        Some(browser)
    }

    /// A frame of text, masked with zeros (RFC 6455, 5.3: the mask may be any).
    fn send(&mut self, text: &str) {
        let n = text.len();
        let mut frame = vec![0x81];
        match n {
            0..126 => frame.push(0x80 | n as u8),
            126..65536 => frame.extend([0x80 | 126, (n >> 8) as u8, n as u8]),
            _ => {
                frame.push(0x80 | 127);
                frame.extend((n as u64).to_be_bytes());
            }
        }
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        self.stream.get_mut().write_all(&frame).unwrap();
    }

    fn receive(&mut self) -> Value {
        let mut text = Vec::new();
        loop {
            let mut head = [0; 2];
            self.stream.read_exact(&mut head).unwrap();
            let length = match head[1] & 0x7f {
                126 => {
                    let mut b = [0; 2];
                    self.stream.read_exact(&mut b).unwrap();
                    u64::from(u16::from_be_bytes(b))
                }
                127 => {
                    let mut b = [0; 8];
                    self.stream.read_exact(&mut b).unwrap();
                    u64::from_be_bytes(b)
                }
                n => u64::from(n),
            };
            let mut part = vec![0; length as usize];
            self.stream.read_exact(&mut part).unwrap();
            if head[0] & 0x0f <= 2 {
                text.extend(part);
                if head[0] & 0x80 != 0 {
                    return serde_json::from_slice(&text).unwrap();
                }
            }
        }
    }

    /// A call of the protocol. What the page logs as an error, and requests to other hosts, fail the test.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.next += 1;
        let mut message = json!({ "id": self.next, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = self.session.clone().into();
        }
        self.send(&message.to_string());
        loop {
            let answer = self.receive();
            if answer["id"] == self.next {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].clone();
            }
            match answer["method"].as_str() {
                Some("Runtime.exceptionThrown") => panic!("the page fails: {}", answer["params"]["exceptionDetails"]),
                Some("Network.requestWillBeSent") => {
                    let url = answer["params"]["request"]["url"].as_str().unwrap_or_default();
                    let own = ["http://127.0.0.1:", "data:", "about:", "blob:http://127.0.0.1:"].iter().any(|p| url.starts_with(p));
                    assert!(own, "a request to another host: {url}");
                }
                Some("Log.entryAdded") => {
                    let entry = &answer["params"]["entry"];
                    let policy = entry["text"].as_str().is_some_and(|t| t.contains("Content Security Policy"));
                    assert!(!policy, "{entry}");
                }
                _ => {}
            }
        }
    }

    /// What an expression of the page comes to; promises are waited for.
    pub fn eval(&mut self, script: &str) -> Value {
        let done = self.call("Runtime.evaluate", json!({ "expression": script, "awaitPromise": true, "returnByValue": true }));
        assert!(done.get("exceptionDetails").is_none(), "{script}: {done}");
        done["result"]["value"].clone()
    }

    /// Waits until an expression of the page is true.
    pub fn until(&mut self, script: &str, seconds: u64) {
        let end = Instant::now() + Duration::from_secs(seconds);
        while self.eval(&format!("!!({script})")) != true {
            let says = || "document.getElementById('answer')?.textContent";
            assert!(Instant::now() < end, "not in {seconds} s: {script}; the page says {}", self.eval(says()));
            std::thread::sleep(Duration::from_millis(40));
        }
    }

    pub fn go(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
        self.until("document.documentElement?.dataset.ready === 'true'", 60);
    }

    /// Presses a key as a reader does.
    pub fn key(&mut self, key: &str) {
        let (code, text) = match key {
            "Enter" => (13, "\r"),
            "Tab" => (9, ""),
            "ArrowRight" => (39, ""),
            _ => (0, ""),
        };
        for kind in ["keyDown", "keyUp"] {
            let mut press = json!({ "type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code });
            if kind == "keyDown" && !text.is_empty() {
                press["text"] = text.into();
            }
            self.call("Input.dispatchKeyEvent", press);
        }
    }
}
