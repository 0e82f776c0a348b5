-- Version 2. Who asked for a job that has not ended: the request_id of every call that was answered with it, '' for calls
-- without one. A caller that withdraws ends the job only when no other is left.
CREATE TABLE job_requesters (
  job_id     INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  request_id TEXT NOT NULL,
  PRIMARY KEY (job_id, request_id)
) STRICT, WITHOUT ROWID;
