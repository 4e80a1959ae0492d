//! Chromium with the page of a phantom, driven like a user.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fantoccini::actions::{InputSource, MOUSE_BUTTON_LEFT, MouseActions, PointerAction};
use fantoccini::wd::WebDriverCompatibleCommand;
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use image::RgbImage;
use ppa_studio::{Endpoint, Opening, Studio, serve};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::browser::fine_phantom;

/// Timeout of anything on the page.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Runs a browser test.
pub fn run(test: impl Future<Output = ()>) {
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    runtime.enable_all().build().unwrap().block_on(test);
}

/// A served phantom and a browser that shows it.
pub struct Page {
    pub client: Client,
    pub folder: TempDir,
    opening: Opening,
    /// Folder that stores the address for a restart.
    last: TempDir,
    served: Served,
    driver: Driver,
}

struct Served {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    /// Serves the page, at the previous address if possible; also returns the address.
    fn begin(opening: &Opening, last: &Path) -> (Self, String) {
        let last = last.join("private/last.json");
        let endpoint = Endpoint::open(([127, 0, 0, 1], 0).into(), Some(&last)).unwrap();
        let Endpoint { listener, token } = endpoint;
        let studio = Studio::open_with(opening, token).unwrap();
        let address = studio.address(listener.local_addr().unwrap());
        let (stop, stopped) = channel();
        let thread = std::thread::spawn(move || serve(studio, listener, stopped).unwrap());
        let served = Self {
            stop: Some(stop),
            thread: Some(thread),
        };
        (served, address)
    }

    fn end(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.end();
    }
}

struct Driver(Child);

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Page {
    pub async fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let case = fine_phantom(folder.path());
        Self::of(folder, &case).await
    }

    /// Opens a scan, case, plan or dataset in a folder.
    pub async fn of(folder: TempDir, path: &Path) -> Self {
        Self::opened(folder, &Opening::of(path)).await
    }

    pub async fn opened(folder: TempDir, opening: &Opening) -> Self {
        Self::drawn_by(&WEBGL, folder, opening).await
    }

    /// Opens the phantom in a browser without WebGL.
    pub async fn without_webgl() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let case = fine_phantom(folder.path());
        Self::drawn_by(&["--disable-3d-apis"], folder, &Opening::of(&case)).await
    }

    async fn drawn_by(graphics: &[&str], folder: TempDir, opening: &Opening) -> Self {
        let last = tempfile::tempdir().unwrap();
        let (served, address) = Served::begin(opening, last.path());
        let (driver, client) = browser(graphics).await;
        client.goto(&address).await.unwrap();
        let page = Self {
            client,
            folder,
            opening: opening.clone(),
            last,
            served,
            driver,
        };
        page.wait("document.getElementById('name').textContent !== ''")
            .await;
        page
    }

    /// Waits until an expression in the page is true.
    pub async fn wait(&self, expression: &str) {
        let started = Instant::now();
        while self.value(expression).await != json!(true) {
            let message = self
                .value("document.getElementById('message')?.textContent")
                .await;
            assert!(
                started.elapsed() < PATIENCE,
                "{expression} is not true; the page says {message}"
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    /// Waits until something outside the page is true, such as the contents of a file.
    pub async fn until(&self, is: impl Fn() -> bool) {
        let started = Instant::now();
        while !is() {
            assert!(started.elapsed() < PATIENCE);
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    pub async fn value(&self, expression: &str) -> Value {
        let script = format!("return {expression};");
        self.client.execute(&script, vec![]).await.unwrap()
    }

    pub async fn click(&self, selector: &str) {
        let found = self.client.find(Locator::Css(selector)).await;
        found
            .unwrap_or_else(|error| panic!("{selector}: {error}"))
            .click()
            .await
            .unwrap();
    }

    /// Replaces the content of a field by typing, and leaves the field.
    pub async fn fill(&self, selector: &str, text: &str) {
        let field = self.client.find(Locator::Css(selector)).await.unwrap();
        field.click().await.unwrap();
        let select_all = "\u{e009}a\u{e000}";
        field
            .send_keys(&format!("{select_all}{text}\u{e004}"))
            .await
            .unwrap();
    }

    /// Presses a key at the focused element.
    pub async fn press(&self, key: &str) {
        let focused = self.client.active_element().await.unwrap();
        focused.send_keys(key).await.unwrap();
    }

    /// Moves a slider as by dragging.
    pub async fn slide(&self, id: &str, value: f64) {
        self.set(id, json!(value)).await;
    }

    /// Chooses from a list.
    pub async fn pick(&self, id: &str, value: &str) {
        self.set(id, json!(value)).await;
    }

    async fn set(&self, id: &str, value: Value) {
        self.client
            .execute(
                "const s = document.getElementById(arguments[0]); s.value = arguments[1]; \
                 s.dispatchEvent(new Event('input', {bubbles: true})); s.dispatchEvent(new Event('change', {bubbles: true}));",
                vec![json!(id), value],
            )
            .await
            .unwrap();
    }

    /// Delays the answer to the next request below a path by a second; then sets `window.late`.
    pub async fn delay_next(&self, path: &str) {
        let script = "const [path] = arguments; const immediate = window.fetch; window.late = false; \
                      window.fetch = async (asked, options) => { \
                        if (!asked.startsWith(path)) return immediate(asked, options); \
                        window.fetch = immediate; \
                        const answer = await immediate(asked, options); \
                        await new Promise((done) => { setTimeout(done, 1000); }); \
                        setTimeout(() => { window.late = true; }, 200); \
                        return answer; };";
        self.client
            .execute(script, vec![json!(path)])
            .await
            .unwrap();
    }

    /// Saves a screenshot in the folder `PPA_PAGE_PICTURES`, if set.
    pub async fn picture(&self, name: &str) {
        if let Some(folder) = std::env::var_os("PPA_PAGE_PICTURES") {
            let png = self.client.screenshot().await.unwrap();
            std::fs::write(PathBuf::from(folder).join(format!("{name}.png")), png).unwrap();
        }
    }

    /// Ends the program, but not the browser.
    pub fn stop(&mut self) {
        self.served.end();
    }

    /// Starts the program again.
    pub fn start_again(&mut self) {
        self.served = Served::begin(&self.opening, self.last.path()).0;
    }

    /// Captures an element of the page: left, top, width and height in the page, and its pixels.
    pub async fn seen(&self, selector: &str) -> ([u32; 4], RgbImage) {
        let script = "const r = document.querySelector(arguments[0]).getBoundingClientRect(); \
                      return [r.x, r.y, r.width, r.height].map(Math.floor);";
        let place = self.client.execute(script, vec![json!(selector)]).await;
        let place: [u32; 4] = serde_json::from_value(place.unwrap()).unwrap();
        let [x, y, width, height] = place;
        let png = self.client.screenshot().await.unwrap();
        let page = image::load_from_memory(&png).unwrap();
        (place, page.crop_imm(x, y, width, height).to_rgb8())
    }

    /// Drags with the mouse between two places of the page.
    pub async fn drag(&self, from: [f64; 2], to: [f64; 2]) {
        let button = MOUSE_BUTTON_LEFT;
        let at = |share: f64| PointerAction::MoveTo {
            duration: Some(Duration::from_millis(30)),
            x: from[0] + share * (to[0] - from[0]),
            y: from[1] + share * (to[1] - from[1]),
        };
        let mouse = MouseActions::new("mouse".to_owned())
            .then(at(0.0))
            .then(PointerAction::Down { button })
            .then(at(0.5))
            .then(at(1.0))
            .then(PointerAction::Up { button });
        self.client.perform_actions(mouse).await.unwrap();
    }

    /// Ends the browser; its console must have no unexpected errors.
    pub async fn close(self) {
        let log = self.client.issue_cmd(ConsoleLog).await.unwrap();
        let severe: Vec<&Value> = (log.as_array().unwrap().iter())
            .filter(|entry| entry["level"] == "SEVERE")
            // Superseded requests and values refused at a field are expected.
            .filter(|entry| {
                let message = entry["message"].as_str().unwrap_or_default();
                !(message.contains("409")
                    || message.contains("/plan/key") && message.contains("422"))
            })
            .collect();
        assert!(severe.is_empty(), "{severe:?}");
        self.client.close().await.unwrap();
        drop(self.served);
        drop(self.driver);
    }
}

/// Options for WebGL 2 on the CPU.
const WEBGL: [&str; 2] = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

async fn browser(graphics: &[&str]) -> (Driver, Client) {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = free.local_addr().unwrap().port();
    drop(free);
    let mut command = Command::new("chromedriver");
    command.arg(format!("--port={port}"));
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let driver = Driver(command.spawn().expect("chromedriver is installed"));
    let always = [
        "--headless=new",
        "--no-sandbox",
        "--window-size=1280,800",
        "--force-device-scale-factor=1",
    ];
    let arguments = [&always, graphics].concat();
    let options = json!({ "args": arguments });
    let wishes =
        json!({ "goog:chromeOptions": options, "goog:loggingPrefs": { "browser": "ALL" } });
    let wishes = wishes.as_object().unwrap().clone();
    let address = format!("http://127.0.0.1:{port}");
    let started = Instant::now();
    loop {
        let mut builder = ClientBuilder::new(HttpConnector::new());
        match builder.capabilities(wishes.clone()).connect(&address).await {
            Ok(client) => return (driver, client),
            Err(error) => assert!(started.elapsed() < PATIENCE, "{error}"),
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

/// Chromium's own command for the console messages.
#[derive(Debug)]
struct ConsoleLog;

impl WebDriverCompatibleCommand for ConsoleLog {
    fn endpoint(
        &self,
        base: &url::Url,
        session: Option<&str>,
    ) -> Result<url::Url, url::ParseError> {
        base.join(&format!("session/{}/se/log", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &url::Url) -> (http::Method, Option<String>) {
        let body = json!({ "type": "browser" });
        (http::Method::POST, Some(body.to_string()))
    }
}
