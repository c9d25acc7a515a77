//! HTTP and WebSocket: files of the table, and a socket for each page and joint; host, a thread of its own.

use crate::assets::{HEADERS, HTML, find};
use crate::guard::Guard;
use crate::message::{LONGEST, parse};
use crate::owner::{Owner, Session, Setup, Syncs, Told, UNREAD, Wants};
use crate::reports::{self, Reports};
use axum::Router;
use axum::body::Body;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE, COOKIE, HOST, LOCATION, ORIGIN, SET_COOKIE};
use axum::http::{HeaderMap, HeaderName, Method, StatusCode, Uri};
use axum::response::Response;
use axum::routing::get;
use bus::client::Network;
use friction_compensation::parameters::authentication::Key;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot};

/// A page that takes no message for so long is given up.
const SLOWEST: Duration = Duration::from_secs(2);
/// Close codes of RFC 6455, section 7.4.1: data of a kind that is not taken; data that is not as it should be; rules of
/// this server.
const UNSUPPORTED: u16 = 1003;
const INVALID: u16 = 1007;
const POLICY: u16 = 1008;

/// State that is served.
#[derive(Debug)]
pub struct Panel {
    network: Network,
    node: u8,
    key: Option<Key>,
    syncs: Arc<Syncs>,
    reports: Arc<Reports>,
    robot: Option<Arc<Value>>,
    guard: Guard,
    owners: Mutex<HashMap<u8, Owner>>,
    /// Told where the address of the page has become another one.
    announce: fn(&str),
}

impl Panel {
    /// Joints of a bus, `node` where a page names none, with `rate` SYNCs a second.
    pub fn new(network: &Network, node: u8, key: Option<Key>, rate: f64, guard: Guard, announce: fn(&str)) -> Self {
        let syncs = Arc::new(Syncs::new(network, rate));
        let (reports, owners) = (Arc::default(), Mutex::default());
        Self { network: network.clone(), node, key, syncs, reports, robot: None, guard, owners, announce }
    }

    /// The same with the robot that the joints belong to, by [`crate::skeleton`].
    #[must_use]
    pub fn with_robot(mut self, robot: Value) -> Self {
        self.robot = Some(Arc::new(robot));
        self
    }

    fn attach(&self, node: u8, wants: Wants, tell: mpsc::Sender<Told>) -> Option<Session> {
        let mut owners = self.owners.lock().unwrap_or_else(PoisonError::into_inner);
        let (network, key) = (self.network.clone(), self.key.clone());
        let (syncs, reports, robot) = (Arc::clone(&self.syncs), Arc::clone(&self.reports), self.robot.clone());
        let setup = Setup { network, node, key, syncs, reports, robot };
        let owner = owners.entry(node).or_insert_with(|| Owner::begin(setup));
        owner.attach(wants, tell)
    }

    /// Node of a path's last part.
    fn node(&self, name: &str) -> Option<u8> {
        match name {
            "default" => Some(self.node),
            number => number.parse().ok().filter(|node| matches!(node, 1..=127)),
        }
    }
}

/// A server that runs until it is dropped. Then pages are disconnected and joints stopped.
#[derive(Debug)]
pub struct Server {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<std::io::Result<()>>>,
}

impl Server {
    /// Serves on a listener.
    ///
    /// # Errors
    /// The operating system's.
    pub fn begin(listener: TcpListener, panel: Panel) -> std::io::Result<Self> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (stop, stopped) = oneshot::channel();
        let panel = Arc::new(panel);
        let thread = std::thread::spawn(move || {
            let served = runtime.block_on(async {
                let listener = tokio::net::TcpListener::from_std(listener)?;
                tokio::select! {
                    served = axum::serve(listener, router(Arc::clone(&panel))) => served,
                    _ = stopped => Ok(()),
                }
            });
            // Pages go first, and with them their holds; then the joints' owners end with the panel.
            drop(runtime);
            drop(panel);
            served
        });
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            // The outcome of the thread interests nobody any more.
            let _ = thread.join();
        }
    }
}

fn router(panel: Arc<Panel>) -> Router {
    let joint = |wants| get(move |panel, path, headers, upgrade| joint(wants, panel, path, headers, upgrade));
    Router::new()
        .route("/joint/{node}", joint(Wants::ToCommand))
        .route("/joint/{node}/look", joint(Wants::ToLook))
        .fallback(page)
        .with_state(panel)
}

/// An answer; its headers are constants, which are well formed.
fn answer(status: StatusCode, headers: &[(HeaderName, &str)], body: Body) -> Response {
    let mut response = Response::new(body);
    *response.status_mut() = status;
    let fixed = HEADERS.into_iter().map(|(name, value)| (HeaderName::from_static(name), value));
    for (name, value) in fixed.chain(headers.iter().cloned()) {
        if let Ok(value) = value.parse() {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

fn refuse(status: StatusCode, reason: &str) -> Response {
    answer(status, &[(CONTENT_TYPE, "text/plain; charset=utf-8")], Body::from(format!("{reason}\n")))
}

/// A header's value; one that is there twice, or no text, is none that fits.
fn header(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?;
    match values.next() {
        None => Some(first.to_str().unwrap_or("no text")),
        Some(_) => Some("given twice"),
    }
}

fn admit(panel: &Panel, headers: &HeaderMap, socket: bool) -> Result<(), String> {
    let [host, origin, cookie] = [HOST, ORIGIN, COOKIE].map(|name| header(headers, name));
    panel.guard.admit(host, origin, cookie, socket).map_err(|refusal| refusal.to_string())
}

async fn page(State(panel): State<Arc<Panel>>, method: Method, uri: Uri, headers: HeaderMap) -> Response {
    let token = uri.query().and_then(|query| query.strip_prefix("token="));
    if let (Some(token), "/") = (token, uri.path()) {
        let [host, origin] = [HOST, ORIGIN].map(|name| header(&headers, name));
        let before = panel.guard.address();
        let redeemed = panel.guard.redeem(host, origin, token, Instant::now());
        let now = panel.guard.address();
        if now != before {
            (panel.announce)(&now);
        }
        return match redeemed {
            Ok(cookie) => answer(StatusCode::SEE_OTHER, &[(LOCATION, "/"), (SET_COOKIE, &cookie)], Body::empty()),
            Err(refusal) => refuse(StatusCode::FORBIDDEN, &refusal.to_string()),
        };
    }
    if let Err(refusal) = admit(&panel, &headers, false) {
        return refuse(StatusCode::FORBIDDEN, &refusal);
    }
    if method != Method::GET {
        return refuse(StatusCode::METHOD_NOT_ALLOWED, "this server is read with GET");
    }
    if let Some(report) = panel.reports.find(uri.path()) {
        let headers = [(CONTENT_TYPE, HTML), (CONTENT_SECURITY_POLICY, reports::POLICY)];
        return answer(StatusCode::OK, &headers, Body::from(report.to_string()));
    }
    match find(uri.path()) {
        Some(asset) => answer(StatusCode::OK, &[(CONTENT_TYPE, asset.kind)], Body::from(asset.text)),
        None => refuse(StatusCode::NOT_FOUND, "this server has no such file"),
    }
}

async fn joint(
    wants: Wants,
    State(panel): State<Arc<Panel>>,
    Path(name): Path<String>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    if let Err(refusal) = admit(&panel, &headers, true) {
        return refuse(StatusCode::FORBIDDEN, &refusal);
    }
    let Some(node) = panel.node(&name) else {
        return refuse(StatusCode::NOT_FOUND, "a node id is 1 to 127");
    };
    match upgrade {
        Ok(upgrade) => upgrade
            .max_message_size(LONGEST)
            .max_frame_size(LONGEST)
            .on_upgrade(move |socket| async move { talk(socket, &panel, node, wants).await }),
        Err(rejection) => refuse(StatusCode::BAD_REQUEST, &rejection.body_text()),
    }
}

/// A page's conversation. However it ends, its session ends with it, and with the session its hold.
async fn talk(mut socket: WebSocket, panel: &Panel, node: u8, wants: Wants) {
    let (tell, mut told) = mpsc::channel(UNREAD);
    let Some(session) = panel.attach(node, wants, tell) else {
        close(&mut socket, POLICY, "too many pages wait for this joint").await;
        return;
    };
    loop {
        // While a page takes no messages, its held-messages are not read either: the joint stops.
        tokio::select! {
            message = socket.recv() => match message {
                Some(Ok(Message::Text(text))) => match parse(&text) {
                    Ok(message) => {
                        let id = message.id;
                        if let Err(error) = session.take(message) {
                            let answer = json!({ "answer": id, "error": error }).to_string();
                            if !send(&mut socket, answer).await {
                                return;
                            }
                        }
                    }
                    Err(error) => {
                        drop(session);
                        close(&mut socket, INVALID, &error).await;
                        return;
                    }
                },
                Some(Ok(Message::Binary(_))) => {
                    drop(session);
                    close(&mut socket, UNSUPPORTED, "messages are text").await;
                    return;
                }
                // Pongs are sent by the library.
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Err(error)) => {
                    drop(session);
                    close(&mut socket, INVALID, &error.to_string()).await;
                    return;
                }
                Some(Ok(Message::Close(_))) | None => return,
            },
            text = told.recv() => match text {
                Some(text) => {
                    if !send(&mut socket, text.to_string()).await {
                        return;
                    }
                }
                None => {
                    drop(session);
                    close(&mut socket, POLICY, "the page reads too slowly").await;
                    return;
                }
            },
        }
    }
}

async fn send(socket: &mut WebSocket, text: String) -> bool {
    matches!(tokio::time::timeout(SLOWEST, socket.send(Message::Text(text.into()))).await, Ok(Ok(())))
}

/// Says why, and ends the connection. Where it is broken nothing arrives.
async fn close(socket: &mut WebSocket, code: u16, reason: &str) {
    if send(socket, json!({ "error": reason }).to_string()).await {
        // A close frame has room for 123 bytes; the message before it has all of the words.
        let short = reason.chars().filter(char::is_ascii).take(120).collect::<String>();
        let frame = CloseFrame { code, reason: short.into() };
        let _ = tokio::time::timeout(SLOWEST, socket.send(Message::Close(Some(frame)))).await;
    }
}
