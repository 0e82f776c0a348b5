-- Version 3. A tile set's picture, a PNG made by a job of its own; NULL until that has run. Tile sets of older catalogs have
-- none until they are put again.
ALTER TABLE tile_sets ADD COLUMN thumbnail_sha256 TEXT REFERENCES blobs (sha256);
CREATE INDEX tile_sets_by_thumbnail ON tile_sets (thumbnail_sha256);
