//! The studio over HTTP, and its page in Chromium.

mod browser;
mod cameras;
mod chromium;
mod dataset;
mod edits;
mod generation;
mod grading;
mod images;
mod kept_bodies;
mod live;
mod networks;
mod page;
mod page_access;
mod page_dataset;
mod page_generation;
mod page_training;
mod page_views;
mod plan_cameras;
mod plan_form;
mod plans;
mod protection;
mod trainings;
