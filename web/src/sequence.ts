// A sequence as rows of figures: the table of `sequence finish`, or else what the index says.
import {rowName, type IndexJson, type ResultJson, type Source} from './data';

/** Of src/pencilscan/page/sequence_part.h. */
interface SequenceJson {
  broken?: string;
  frames: string[];
  states: string[];
  columns: Record<string, (number | null)[]>;
  remarks: [number, string][];
  events: {frame?: string; last_frame?: string; text?: string}[];
  holes: {frame?: string; state?: string; reason?: string}[];
  cameras: string[];
  projectors: string[];
}

export interface TimeMark {
  kind: 'event' | 'warning' | 'hole';
  first: number; // row
  last: number;
  text: string;
}

/** Neighbours that say the same become one. */
export function joined(marks: TimeMark[]): TimeMark[] {
  const result: TimeMark[] = [];
  const open = new Map<string, TimeMark>();
  for (const mark of marks) {
    const key = `${mark.kind} ${mark.text}`;
    const before = open.get(key);
    if (before && mark.kind !== 'event' && mark.first <= before.last + 1) {
      before.last = mark.last;
      continue;
    }
    const own = {...mark};
    open.set(key, own);
    result.push(own);
  }
  return result.sort((a, b) => a.first - b.first);
}

export class Sequence {
  readonly devices: string[];
  readonly marks: TimeMark[];
  private readonly rowOfResult: number[];
  private readonly resultOfRow: number[];

  private constructor(private readonly json: SequenceJson, results: ResultJson[], readonly remark: string) {
    const rows = new Map(json.frames.map((name, row) => [name, row]));
    this.rowOfResult = results.map((result) => rows.get(nameOf(result)) ?? -1);
    this.resultOfRow = json.frames.map(() => -1);
    this.rowOfResult.forEach((row, result) => {
      if (row >= 0) this.resultOfRow[row] = result;
    });
    this.devices = [...json.cameras, ...json.projectors];
    this.marks = joined([
      ...json.remarks.map(([row, text]): TimeMark => ({kind: 'warning', first: row, last: row, text})),
      ...json.holes.map(({frame, state, reason}): TimeMark => {
        const row = rows.get(frame ?? '') ?? -1;
        return {kind: 'hole', first: row, last: row, text: [state, reason].filter(Boolean).join(': ')};
      }),
      ...json.events.map(({frame, last_frame: lastFrame, text}): TimeMark => {
        const row = rows.get(frame ?? '') ?? -1;
        return {kind: 'event', first: row, last: rows.get(lastFrame ?? '') ?? row, text: text ?? ''};
      }),
    ].filter(({first}) => first >= 0));
  }

  static async read(source: Source): Promise<Sequence> {
    const {results, sequence} = source.index;
    const own = () => ofSummaries(source.index);
    if (!sequence) return new Sequence(own(), results, 'Events and more curves: pencilscan sequence finish');
    const json = await source.sequence<SequenceJson>().catch((error: unknown) =>
      ({broken: String(error)}) as SequenceJson);
    if (json.broken !== undefined) return new Sequence(own(), results, `sequence.json cannot be read: ${json.broken}`);
    const known = new Set(json.frames);
    if (results.some((result) => !known.has(nameOf(result)))) {
      return new Sequence(own(), results, 'sequence.json knows other frames: run pencilscan sequence finish again');
    }
    return new Sequence(json, results, '');
  }

  get length(): number {
    return this.json.frames.length;
  }

  name(row: number): string {
    return this.json.frames[row];
  }

  /** -1: that frame has no result. */
  resultOf(row: number): number {
    return this.resultOfRow[row] ?? -1;
  }

  rowOf(result: number): number {
    return this.rowOfResult[result] ?? -1;
  }

  /** device: '' for all. Undefined where nobody knows that figure. */
  column(figure: string, device = ''): (number | null)[] | undefined {
    const column = this.json.columns[device ? `${device}.${figure}` : figure];
    return column?.some((value) => value !== null) ? column : undefined;
  }
}

const nameOf = ({run, name}: ResultJson): string => rowName(run, name);

/** Of what every result says itself. Frames that failed have their row too, without figures. */
function ofSummaries({results, failed}: IndexJson): SequenceJson {
  const done = results.map((result) => ({run: result.run, name: result.name, result}));
  const lacking = failed.map(({run, frame, why}) => ({run, name: frame, why, result: undefined}));
  const inOrder = (a: {run: string; name: string}, b: {run: string; name: string}) =>
    compare(a.run, b.run) || compare(a.name, b.name);
  const rows = [...done, ...lacking].sort(inOrder);
  const column = (key: string) => rows.map(({result}) => result?.summary[key] ?? null);
  return {
    frames: rows.map(({run, name}) => rowName(run, name)),
    states: rows.map(({result}) => (result ? 'done' : 'failed')),
    columns: {points: column('points'), measured_share: column('measured_share'), crossing_px: column('median_px')},
    remarks: rows.flatMap(({result}, row): [number, string][] =>
      result?.summary.warnings ? [[row, `${result.summary.warnings} to look at`]] : []),
    holes: lacking.map(({run, name, why}) => ({frame: rowName(run, name), reason: why})),
    events: [], cameras: [], projectors: [],
  };
}

const compare = (a: string, b: string): number => (a < b ? -1 : a > b ? 1 : 0);
