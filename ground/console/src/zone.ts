import type { ZoneKind } from './vocabulary';

/** A zone as it is drawn, stored and sent: metres east and north, heights in metres, seconds since 1970. */
export interface ZoneTable {
  name: string;
  kind: ZoneKind;
  centre_m?: [number, number];
  radius_m?: number;
  corners_m?: [number, number][];
  floor_m?: number;
  ceiling_m?: number;
  height_m?: number;
  from_s?: number;
  until_s?: number;
}
