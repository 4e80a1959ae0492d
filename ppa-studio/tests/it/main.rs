//! The studio over HTTP, and its page in Chromium.

mod browser;
mod chromium;
mod dataset;
mod edits;
mod generation;
mod images;
mod networks;
mod page;
mod page_access;
mod page_dataset;
mod page_generation;
mod plan_form;
mod plans;
mod protection;
