//! Behaviour of the program as its users meet it: the command line on studies in temporary folders, and the rules of the house.

mod bad_input;
mod committed;
mod damage;
mod distant;
mod formula;
mod hammer;
mod handbook;
mod hidden;
mod hostile;
mod house;
mod missing;
mod new;
mod rig;
mod round_trip;
mod settling;
mod shapes;
mod slopes;
mod slack;
mod stopping;
mod studies;
mod tensioner;
mod tolerance;
mod trial;
mod verbs;
mod workbench;
