// The page: what comes from the tool goes to its parts, and their requests go back.

import { Calibration } from "./calibration.js";
import { connect } from "./connection.js";
import { Measurements } from "./measurements.js";
import { LinePlot, TimePlots } from "./plots.js";
import { Readings } from "./readings.js";
import { TouchMap } from "./touch.js";

const plots = new TimePlots();
const line = new LinePlot();
const touch = new TouchMap();
const measurements = new Measurements();
const readings = new Readings((request) => send(request));
const calibration = new Calibration((request) => send(request));

const send = connect(
  (message) => {
    if (message.samples) plots.add(message.samples);
    if (message.line) line.show(message.line);
    if (message.measurements) measurements.take(message.measurements);
    if (message.skipped) readings.skip(message.skipped);
    if (message.state) {
      readings.show(message.state);
      touch.show(message.state);
      measurements.show(message.state.time_ms);
      calibration.show(message.state.calibration);
    }
  },
  (isConnected) => {
    readings.connect(isConnected);
    plots.interrupt();
  },
);
