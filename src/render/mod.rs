//! Settings, plan, tiles, progress, statistics: a render from request to film.
