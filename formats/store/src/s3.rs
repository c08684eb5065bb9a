//! Buckets: S3, and what speaks its language, as storage that has the store at its root.
//!
//! Two writers meet at `PUT` with `If-None-Match: *`: a version can be written once. Nothing else
//! keeps them apart, so that header is always sent, whatever the environment says, and storage that
//! does not heed it is refused when a store is created
//! ([`Place::refuse_lost_commits`](crate::location::Place::refuse_lost_commits)).

use std::sync::Arc;
use std::time::Duration;

use deltalake::logstore::ObjectStoreRef;
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey, S3ConditionalPut};
use object_store::path::Path as ObjectPath;
use object_store::prefix::PrefixStore;
use object_store::{ClientConfigKey, Error as ObjectError, RetryConfig};
use url::Url;

/// Scheme of the URLs.
pub(crate) const SCHEME: &str = "s3";

/// Time for one request with its body: a data file may be hundreds of megabytes.
const REQUEST_TIMEOUT: &str = "300 s";

/// How long a request that fails is tried again. Long enough for a node of the storage to come back,
/// short enough for a person who mistyped the endpoint.
const RETRY_TIMEOUT: Duration = Duration::from_secs(20);

/// Tries again of one request.
const MAX_RETRIES: usize = 4;

/// The storage behind `s3://bucket/prefix`, with the prefix as its root.
pub(crate) fn storage(url: &Url) -> Result<ObjectStoreRef, String> {
    let bucket = bucket(url, std::env::vars())?;
    let prefix = ObjectPath::from_url_path(url.path()).map_err(|error| error.to_string())?;
    Ok(Arc::new(PrefixStore::new(bucket, prefix)))
}

fn bucket(
    url: &Url,
    variables: impl Iterator<Item = (String, String)>,
) -> Result<AmazonS3, String> {
    let name = url.host_str().filter(|name| !name.is_empty());
    let name = name.ok_or("it names no bucket (s3://BUCKET/PREFIX is meant)")?;
    let mut builder = configured(variables)?.with_bucket_name(name);
    if endpoint(&builder).is_some_and(|endpoint| endpoint.starts_with("http://")) {
        builder = builder.with_allow_http(true);
    }
    builder.build().map_err(|error| error.to_string())
}

/// The `AWS_...` variables of the environment that the client knows; others are left alone.
fn configured(
    variables: impl Iterator<Item = (String, String)>,
) -> Result<AmazonS3Builder, String> {
    let timeout = AmazonS3ConfigKey::Client(ClientConfigKey::Timeout);
    let retry = RetryConfig {
        max_retries: MAX_RETRIES,
        retry_timeout: RETRY_TIMEOUT,
        ..RetryConfig::default()
    };
    let mut builder = AmazonS3Builder::new()
        .with_config(timeout, REQUEST_TIMEOUT)
        .with_retry(retry);
    for (name, value) in
        variables.filter(|(name, value)| name.starts_with("AWS_") && !value.is_empty())
    {
        if let Ok(key) = name.to_ascii_lowercase().parse() {
            builder = builder.with_config(key, value);
        }
    }
    Ok(builder.with_conditional_put(S3ConditionalPut::ETagMatch))
}

fn endpoint(builder: &AmazonS3Builder) -> Option<String> {
    let of = |key| builder.get_config_value(&key);
    of(AmazonS3ConfigKey::S3Endpoint).or_else(|| of(AmazonS3ConfigKey::Endpoint))
}

/// Whether there is not even a bucket.
pub(crate) fn lacks_bucket(error: &ObjectError) -> bool {
    error.to_string().contains("NoSuchBucket")
}

/// Why a bucket cannot be read, what mends it, and what the storage said.
pub(crate) fn in_words(error: &ObjectError) -> String {
    let said = error.to_string();
    let what = match error {
        _ if lacks_bucket(error) => {
            "there is no such bucket; create it, or mend its name, AWS_REGION or AWS_ENDPOINT_URL"
        }
        ObjectError::PermissionDenied { .. } | ObjectError::Unauthenticated { .. } => {
            "the credentials are refused; mend AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and \
             AWS_SESSION_TOKEN, or ask for the right to list, get, put and delete there"
        }
        _ if said.contains("169.254.169.254") => {
            "there are no credentials; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY \
             (profiles in ~/.aws are not read)"
        }
        _ => "it does not answer; mend AWS_ENDPOINT_URL or AWS_REGION, or try again later",
    };
    format!(
        "{what} ({})",
        code(&said).unwrap_or_else(|| first_line(&said))
    )
}

/// S3's own name for what is wrong, as in `SignatureDoesNotMatch`.
fn code(said: &str) -> Option<&str> {
    let (_, rest) = said.split_once("<Code>")?;
    rest.split_once("</Code>").map(|(code, _)| code)
}

fn first_line(said: &str) -> &str {
    said.lines().next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use object_store::aws::AmazonS3ConfigKey::{ConditionalPut, Endpoint, Region};

    use super::*;

    fn variables<const N: usize>(
        of: [(&'static str, &'static str); N],
    ) -> impl Iterator<Item = (String, String)> {
        of.into_iter()
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
    }

    #[test]
    fn the_environment_cannot_take_the_writers_apart() {
        let environment = variables([
            ("AWS_CONDITIONAL_PUT", "disabled"),
            ("AWS_REGION", "eu-central-1"),
            ("AWS_ENDPOINT_URL", "http://127.0.0.1:9000"),
            ("AWS_UNKNOWN_TO_US", "1"),
            ("AWS_DEFAULT_REGION", ""),
            ("HOME", "/root"),
        ]);
        let builder = configured(environment).unwrap();
        let of = |key| builder.get_config_value(&key);
        assert_eq!(of(ConditionalPut).as_deref(), Some("etag"));
        assert_eq!(of(Region).as_deref(), Some("eu-central-1"));
        assert_eq!(of(Endpoint).as_deref(), Some("http://127.0.0.1:9000"));
    }

    #[test]
    fn a_url_needs_a_bucket() {
        let built = |url: &str| bucket(&Url::parse(url).unwrap(), variables([]));
        assert!(
            built("s3:///city/")
                .unwrap_err()
                .contains("s3://BUCKET/PREFIX")
        );
        let shown = built("s3://maps.example/city/").unwrap().to_string();
        assert!(shown.contains("maps.example"), "{shown}");
    }
}
