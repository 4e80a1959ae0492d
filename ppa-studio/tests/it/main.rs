//! The studio over HTTP, and its page in Chromium.

mod browser;
mod chromium;
mod edits;
mod images;
mod page;
mod protection;
