-- Version 1. Times are milliseconds since 1970 (UTC), names of columns carry units.

-- Immutable bytes. Up to 64 KiB lie in `data`; larger ones are files of the blob folder named by their digest.
CREATE TABLE blobs (
  sha256     TEXT PRIMARY KEY CHECK (length(sha256) = 64),
  size_bytes INTEGER NOT NULL CHECK (size_bytes >= 0),
  data       BLOB CHECK (data IS NULL OR length(data) = size_bytes),
  -- Last declared, stored or let go of by a name: a blob without a name is kept for a while after this.
  touch_ms   INTEGER NOT NULL
) STRICT;

CREATE TABLE uploads (
  sha256          TEXT PRIMARY KEY CHECK (length(sha256) = 64),
  size_bytes      INTEGER NOT NULL CHECK (size_bytes > 0),
  committed_bytes INTEGER NOT NULL CHECK (committed_bytes BETWEEN 0 AND size_bytes),
  touch_ms        INTEGER NOT NULL
) STRICT;

CREATE TABLE materials (
  name             TEXT PRIMARY KEY,
  blob_sha256      TEXT NOT NULL REFERENCES blobs (sha256),
  width            INTEGER NOT NULL,
  height           INTEGER NOT NULL,
  codec            TEXT NOT NULL,
  num_coefficients INTEGER NOT NULL,
  num_views        INTEGER NOT NULL,
  num_lights       INTEGER NOT NULL,
  source           TEXT NOT NULL,
  licence          TEXT NOT NULL,
  citation         TEXT NOT NULL,
  radiometry       TEXT NOT NULL,
  metadata_json    TEXT NOT NULL,
  create_ms        INTEGER NOT NULL
) STRICT;
CREATE INDEX materials_by_blob ON materials (blob_sha256);

CREATE TABLE tile_sets (
  arrangement        TEXT NOT NULL,
  name               TEXT NOT NULL,
  blob_sha256        TEXT NOT NULL REFERENCES blobs (sha256),
  arrangement_sha256 TEXT NOT NULL,
  tile_size          INTEGER NOT NULL,
  strip_height       INTEGER NOT NULL,
  num_tiles          INTEGER NOT NULL,
  num_btfels         INTEGER NOT NULL,
  codec              TEXT NOT NULL,
  source             TEXT NOT NULL,
  licence            TEXT NOT NULL,
  citation           TEXT NOT NULL,
  certificate_json   TEXT NOT NULL,
  metadata_json      TEXT NOT NULL,
  create_ms          INTEGER NOT NULL,
  PRIMARY KEY (arrangement, name)
) STRICT;
CREATE INDEX tile_sets_by_blob ON tile_sets (blob_sha256);

CREATE TABLE jobs (
  id               INTEGER PRIMARY KEY AUTOINCREMENT,
  kind             TEXT NOT NULL,
  version          INTEGER NOT NULL,
  params           BLOB NOT NULL,
  -- Hash of (kind, version, inputs, params): equal work has equal values and is done once.
  dedupe_sha256    TEXT NOT NULL,
  result_name      TEXT NOT NULL,
  replace_existing INTEGER NOT NULL CHECK (replace_existing IN (0, 1)),
  state            TEXT NOT NULL CHECK (state IN ('QUEUED', 'RUNNING', 'SUCCEEDED', 'FAILED', 'CANCELLED')),
  -- Runs begun and not handed back; counted when the job is claimed, so that a run that dies counts.
  attempt          INTEGER NOT NULL DEFAULT 0,
  lease_token      TEXT,
  lease_until_ms   INTEGER,
  cancel_requested INTEGER NOT NULL DEFAULT 0 CHECK (cancel_requested IN (0, 1)),
  -- Number of the last event told to watchers; it only grows.
  sequence         INTEGER NOT NULL DEFAULT 1,
  -- Of a job that SUCCEEDED: what it made, so that equal work can take it over.
  result_sha256    TEXT,
  result_message   BLOB,
  error_code       INTEGER,
  error_message    TEXT,
  error_reason     TEXT,
  error_subject    TEXT,
  create_ms        INTEGER NOT NULL,
  start_ms         INTEGER,
  end_ms           INTEGER,
  CHECK ((state = 'RUNNING') = (lease_token IS NOT NULL)),
  CHECK ((state = 'FAILED') = (error_code IS NOT NULL)),
  CHECK ((state IN ('SUCCEEDED', 'FAILED', 'CANCELLED')) = (end_ms IS NOT NULL))
) STRICT;
CREATE INDEX jobs_by_state ON jobs (state, id);
CREATE INDEX jobs_by_dedupe ON jobs (dedupe_sha256, state);

-- Blobs that a job which has not ended needs: it keeps them alive.
CREATE TABLE job_inputs (
  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  place  INTEGER NOT NULL,
  sha256 TEXT NOT NULL REFERENCES blobs (sha256),
  PRIMARY KEY (job_id, place)
) STRICT;
CREATE INDEX job_inputs_by_blob ON job_inputs (sha256);

-- First answers to mutations, for clients that repeat them.
CREATE TABLE requests (
  request_id     TEXT PRIMARY KEY,
  request_sha256 TEXT NOT NULL,
  response       BLOB NOT NULL,
  create_ms      INTEGER NOT NULL
) STRICT;
CREATE INDEX requests_by_time ON requests (create_ms);
