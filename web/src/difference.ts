// How far one surface lies from another one.
import type {Mesh} from './data';
import {nearestVertices} from './nearest';
import {vertexNormals} from './normals';

/** Per vertex of `mesh`, how far it lies before (> 0) or behind the plane that touches `reference` at
 * its nearest vertex; NaN where none is near. What that is off is of second order: the square of the
 * distance to that vertex, over twice the radius of the surface's curvature. */
export function signedDistances(mesh: Mesh, reference: Mesh): Float32Array {
  const nearest = nearestVertices(reference.position, mesh.position);
  const normals = vertexNormals(reference.position, reference.index);
  const distances = new Float32Array(nearest.length);
  for (let i = 0; i < distances.length; ++i) {
    const at = 3 * nearest[i];
    if (at < 0) {
      distances[i] = NaN;
      continue;
    }
    for (let k = 0; k < 3; ++k) {
      distances[i] += (mesh.position[3 * i + k] - reference.position[at + k]) * normals[at + k];
    }
  }
  return distances;
}
