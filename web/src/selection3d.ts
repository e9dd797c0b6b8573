// The selected measurement in space: where it is, its camera's ray, the light sheet of its line.
import type {App} from './app';
import {drawMarker, drawSegments, drawSheet} from './devices3d';
import type {Group} from 'three';

const kColor = 0xff3d6e;

/** Adds it to an empty group. sheet: with the light sheet. */
export function drawSelection(app: App, group: Group, sheet: boolean): void {
  const {selection, points, rig} = app;
  const camera = selection ? app.cameras[selection.camera] : undefined;
  if (selection && selection.point >= 0 && points) {
    const at = app.position(selection.point);
    const marker = drawMarker('#ff3d6e');
    marker.position.set(...at);
    group.add(marker);
    if (camera) group.add(drawSegments([...camera.center, ...at], kColor));
    if (rig && sheet && app.patternOf(selection.point)) {
      group.add(drawSheet(rig, points.projector[selection.point],
        points.pattern[selection.point], points.line[selection.point]));
    }
  } else if (selection && rig && camera) {
    const d = camera.direction(selection.u, selection.v);
    const reach = Math.hypot(...camera.center.map((x, k) => x - rig.volume.center[k])) + rig.volume.radius;
    group.add(drawSegments([...camera.center, ...camera.center.map((x, k) => x + reach * d[k])], kColor));
  }
}
