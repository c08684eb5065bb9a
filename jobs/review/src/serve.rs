//! The page over HTTP, for the people at this machine.
//!
//! Nothing is read but the store and nothing written but the file of decisions: paths in requests
//! are names and numbers that are looked up, never file names. A page on another site must not
//! reach in: requests under a name that is not this machine's are refused (a name can be rebound to
//! this address), answers may not be read or framed by other origins, and a decision needs the
//! origin of the page itself.

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use serde_json::json;

use crate::assets::{self, Asset, Mode};
use crate::decision::{Decision, Decisions, Said};
use crate::documents::Review;
use crate::error::ReviewError;
use crate::gallery::Gallery;

/// Longest request that is read, in bytes.
const MAX_BODY: usize = 64 * 1024;

/// Where, and for whom, the page is served.
#[derive(Debug, Clone)]
pub struct Door {
    /// Address to listen on; port 0 takes a free one.
    pub address: SocketAddr,
    /// Names under which this machine may be asked, besides its addresses and `localhost`.
    pub names: Vec<String>,
    /// File that keeps the decisions; none: decisions are not taken.
    pub decisions: Option<PathBuf>,
    /// The time, UTC as RFC 3339. Only decisions say when they were made.
    pub now: fn() -> String,
}

/// The page is being served.
#[derive(Debug, Clone)]
pub struct Served {
    /// Where it is.
    pub url: String,
    /// Whether it can be reached from other machines.
    pub is_open: bool,
}

struct Desk {
    review: Review,
    door: Door,
    decisions: Option<Mutex<Decisions>>,
    gallery: Option<Gallery>,
}

/// Serves the page until the process ends, with pictures where there is a gallery; tells `ready` once
/// it can be opened.
///
/// # Errors
/// The address cannot be listened on, the decisions cannot be read, or the program has no map
/// library.
pub fn serve(
    review: Review,
    door: Door,
    gallery: Option<Gallery>,
    ready: impl FnOnce(&Served),
) -> Result<(), ReviewError> {
    let library = assets::library()?;
    let decisions = door.decisions.as_deref().map(Decisions::read).transpose()?;
    let address = door.address;
    let desk = Arc::new(Desk {
        review,
        door,
        decisions: decisions.map(Mutex::new),
        gallery,
    });
    let cannot = |source| ReviewError::Listen { address, source };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(cannot)?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::bind(address)
            .await
            .map_err(cannot)?;
        let bound = listener.local_addr().map_err(cannot)?;
        ready(&Served {
            url: format!("http://{bound}/"),
            is_open: !bound.ip().is_loopback(),
        });
        axum::serve(listener, router(desk, library))
            .await
            .map_err(cannot)
    })
}

fn router(desk: Arc<Desk>, library: &'static [Asset]) -> Router {
    let mut router = Router::new()
        .route(
            "/",
            get(|| async { content("text/html; charset=utf-8", assets::page(Mode::Served)) }),
        )
        .route("/data/index", get(index))
        .route("/data/versions/{version}", get(layer))
        .route("/data/coverage/{version}", get(coverage))
        .route("/data/explain/{version}/{change}", get(explain))
        .route("/data/frame/{version}/{change}/{place}", get(frame))
        .route("/data/map/{key}/{zoom}/{column}/{row}", get(tile))
        .route("/data/decisions", get(decisions).post(decide));
    for asset in assets::OURS.iter().chain(library) {
        let file = || async { content(asset.media_type(), asset.bytes) };
        router = router.route(&format!("/{}", asset.path), get(file));
    }
    router
        .layer(DefaultBodyLimit::max(MAX_BODY))
        .layer(middleware::from_fn_with_state(Arc::clone(&desk), guard))
        .with_state(desk)
}

fn content(media_type: &'static str, bytes: impl Into<axum::body::Body>) -> Response {
    ([(header::CONTENT_TYPE, media_type)], bytes.into()).into_response()
}

/// Who asks, and under which name; and what the browser may do with the answer.
async fn guard(State(desk): State<Arc<Desk>>, request: Request, next: Next) -> Response {
    let mut response = match refusal(&desk.door.names, request.method(), request.headers()) {
        Some(why) => (StatusCode::FORBIDDEN, why).into_response(),
        None => next.run(request).await,
    };
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, assets::SERVED_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-cache"),
    ] {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    for name in ["cross-origin-resource-policy", "cross-origin-opener-policy"] {
        let value = HeaderValue::from_static("same-origin");
        response.headers_mut().insert(name, value);
    }
    response
}

/// Why a request is refused, if it is.
fn refusal(names: &[String], method: &Method, headers: &HeaderMap) -> Option<&'static str> {
    let text = |name| {
        headers
            .get(name)
            .and_then(|value: &HeaderValue| value.to_str().ok())
    };
    let Some(host) = text(header::HOST).filter(|host| is_ours(host, names)) else {
        return Some(
            "asked under a name that is not this machine's; open the page by its address, or allow the name with --host",
        );
    };
    if *method == Method::GET || *method == Method::HEAD {
        return None;
    }
    let origin = text(header::ORIGIN).and_then(|origin| origin.split_once("://"));
    let is_same = origin.is_some_and(|(_, from)| from == host);
    let is_json = text(header::CONTENT_TYPE).is_some_and(|of| of.starts_with("application/json"));
    (!is_same || !is_json).then_some("only the page itself may decide")
}

/// Addresses cannot be rebound; names can, so only those that are known are heard.
fn is_ours(host: &str, names: &[String]) -> bool {
    if host.parse::<SocketAddr>().is_ok() || host.parse::<IpAddr>().is_ok() {
        return true;
    }
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let is_address = name.trim_matches(['[', ']']).parse::<IpAddr>().is_ok();
    is_address
        || name.eq_ignore_ascii_case("localhost")
        || names.iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// What went wrong, as the page shows it.
enum Answer {
    Json(Vec<u8>),
    Tile(Vec<u8>),
    Picture(Vec<u8>),
    Nothing,
    NotFound,
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        match self {
            Self::Json(bytes) => content("application/json", bytes),
            Self::Tile(bytes) => content("application/vnd.mapbox-vector-tile", bytes),
            Self::Picture(bytes) => content("image/png", bytes),
            Self::Nothing => StatusCode::NO_CONTENT.into_response(),
            Self::NotFound => StatusCode::NOT_FOUND.into_response(),
        }
    }
}

/// Does what blocks on a thread of its own: the store waits for its storage by itself, and not on a
/// thread that answers.
async fn answer(
    desk: Arc<Desk>,
    work: impl FnOnce(&Desk) -> Result<Answer, ReviewError> + Send + 'static,
) -> Response {
    let (tell, told) = tokio::sync::oneshot::channel();
    let thread = std::thread::Builder::new().name("answer".to_owned());
    let started = thread.spawn(move || {
        // Where nobody waits any more, nothing is to be told.
        let _ = tell.send(work(&desk));
    });
    if started.is_err() {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    }
    match told.await {
        Ok(Ok(answer)) => answer.into_response(),
        Ok(Err(error)) => {
            let status = match error {
                ReviewError::Refused(_) | ReviewError::NoPicture(_) => {
                    StatusCode::UNPROCESSABLE_ENTITY
                }
                _ => StatusCode::INTERNAL_SERVER_ERROR,
            };
            (status, error.to_string()).into_response()
        }
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn index(State(desk): State<Arc<Desk>>) -> Response {
    answer(desk, |desk| {
        let mut index = serde_json::to_value(desk.review.index()?)?;
        index["can_decide"] = desk.decisions.is_some().into();
        index["has_frames"] = desk.gallery.is_some().into();
        Ok(Answer::Json(serde_json::to_vec(&index)?))
    })
    .await
}

async fn layer(State(desk): State<Arc<Desk>>, Path(version): Path<i64>) -> Response {
    answer(desk, move |desk| {
        Ok(Answer::Json(desk.review.version(version)?.layer()?))
    })
    .await
}

async fn coverage(State(desk): State<Arc<Desk>>, Path(version): Path<i64>) -> Response {
    answer(desk, move |desk| {
        Ok(Answer::Json(desk.review.version(version)?.coverage()?))
    })
    .await
}

async fn explain(
    State(desk): State<Arc<Desk>>,
    Path((version, change)): Path<(i64, String)>,
) -> Response {
    answer(desk, move |desk| {
        let told = desk.review.version(version)?.explain(&change)?;
        Ok(match told {
            Some(told) => Answer::Json(serde_json::to_vec(&told)?),
            None => Answer::NotFound,
        })
    })
    .await
}

async fn frame(
    State(desk): State<Arc<Desk>>,
    Path((version, change, place)): Path<(i64, String, usize)>,
) -> Response {
    answer(desk, move |desk| {
        let Some(gallery) = &desk.gallery else {
            return Ok(Answer::NotFound);
        };
        let version = desk.review.version(version)?;
        let picture = gallery.picture(&version, &change, place)?;
        Ok(picture.map_or(Answer::NotFound, Answer::Picture))
    })
    .await
}

async fn tile(
    State(desk): State<Arc<Desk>>,
    Path((key, zoom, column, row)): Path<(String, u8, u32, u32)>,
) -> Response {
    answer(desk, move |desk| {
        let Some(tiles) = desk.review.map(&key)? else {
            return Ok(Answer::NotFound);
        };
        let tile = tiles.tile(zoom, column, row);
        Ok(tile.map_or(Answer::Nothing, Answer::Tile))
    })
    .await
}

async fn decisions(State(desk): State<Arc<Desk>>) -> Response {
    answer(desk, |desk| {
        let Some(decisions) = &desk.decisions else {
            return Ok(Answer::Json(b"[]".to_vec()));
        };
        let decisions = decisions.lock().unwrap_or_else(PoisonError::into_inner);
        let all: Vec<&Decision> = decisions.all().collect();
        Ok(Answer::Json(serde_json::to_vec(&all)?))
    })
    .await
}

/// What the page says when a reviewer decides.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    change: String,
    version: i64,
    decision: Said,
    note: String,
    reviewer: String,
}

async fn decide(State(desk): State<Arc<Desk>>, body: Bytes) -> Response {
    answer(desk, move |desk| {
        let Some(decisions) = &desk.decisions else {
            let why = "no file keeps decisions here; serve with --decisions FILE".to_owned();
            return Err(ReviewError::Refused(why));
        };
        let asked: Asked = serde_json::from_slice(&body)
            .map_err(|error| ReviewError::Refused(error.to_string()))?;
        let version = desk.review.version(asked.version)?;
        let Some(subject) = version.subject(&asked.change)? else {
            let why = format!("version {} has no such change", asked.version);
            return Err(ReviewError::Refused(why));
        };
        let decision = Decision {
            change: asked.change,
            element_id: subject.element,
            version: asked.version,
            verdict: subject.verdict.name().to_owned(),
            decision: asked.decision,
            note: asked.note,
            reviewer: asked.reviewer,
            at: (desk.door.now)(),
        };
        let mut decisions = decisions.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = decisions.add(decision)?;
        Ok(Answer::Json(serde_json::to_vec(&json!(kept))?))
    })
    .await
}

#[cfg(test)]
mod tests {
    use super::*;

    type Pairs<'a> = &'a [(&'static str, &'static str)];

    fn headers(pairs: Pairs<'_>) -> HeaderMap {
        let pairs = pairs.iter().map(|&(name, value)| {
            let name = header::HeaderName::from_static(name);
            (name, HeaderValue::from_static(value))
        });
        pairs.collect()
    }

    #[test]
    fn a_rebound_name_is_refused_and_an_address_is_not() {
        let names = ["maps.example".to_owned()];
        for host in [
            "127.0.0.1:7878",
            "localhost:7878",
            "localhost",
            "[::1]:7878",
            "::1",
            "10.0.0.7:80",
            "maps.example:7878",
        ] {
            assert!(is_ours(host, &names), "{host}");
        }
        for host in [
            "evil.example:7878",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "",
            ":7878",
            "127.0.0.1:7878@evil.example",
        ] {
            assert!(!is_ours(host, &names), "{host}");
        }
        let refused = |pairs: Pairs<'_>| refusal(&[], &Method::GET, &headers(pairs)).is_some();
        assert!(refused(&[]));
        assert!(refused(&[("host", "evil.example")]));
        assert!(!refused(&[("host", "127.0.0.1:7878")]));
    }

    #[test]
    fn only_the_page_itself_decides() {
        let host = ("host", "localhost:7878");
        let json = ("content-type", "application/json");
        let decides = |pairs: Pairs<'_>| refusal(&[], &Method::POST, &headers(pairs)).is_none();
        assert!(decides(&[host, json, ("origin", "http://localhost:7878")]));
        assert!(!decides(&[host, json]));
        assert!(!decides(&[host, json, ("origin", "null")]));
        assert!(!decides(&[host, json, ("origin", "http://localhost:7879")]));
        assert!(!decides(&[host, json, ("origin", "http://evil.example")]));
        assert!(!decides(&[
            host,
            ("origin", "http://localhost:7878"),
            ("content-type", "text/plain")
        ]));
    }
}
