/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of the control socket: faults on request, and the state of the drives.
 *
 *   fault NAME FAULT           NAME is a drive or a bus; see faults.h; `fault NAME none` clears all
 *   power DRIVE off|on|cycle   off: the state is lost; on: parameters as saved
 *   identity DRIVE TEXT        the answer to dev from now on
 *   flash DRIVE fail|ok        whether sav fails
 *   stall DRIVE [on|off]       block the motor
 *   sensor DRIVE N 0|1|auto    force a sensor's level, or end that
 *   bits DRIVE MASK            show these status bits too (0x40 = hardware fault ...); 0 ends it
 *   input DRIVE N 0|1          XYZA: level of input K1..K16; the keys act when theirs becomes 1
 *   place DRIVE AXIS POSITION  XYZA: puts axis x, y, z or a there, standing
 *   baud BUS RATE              the rate of the bus; drives with another bdr receive nothing
 *   get NAME                   one line of key=value
 *   log DRIVE                  the last 64 received lines, "MICROSECONDS LINE" each, oldest first
 *   list                       "bus NAME DEVICE" and "drive NAME BUS-ADDRESS" lines
 *
 * The last line of every answer begins with "ok" or "error".
 */
#ifndef DRIVEBRIDGE_SIM_COMMANDS_H
#define DRIVEBRIDGE_SIM_COMMANDS_H

#include "sim/world.h"

/* Carries out one line (without its end) and writes the answer to `out`. The line is modified. */
void sim_command(struct sim_world *world, char *line, db_time now, FILE *out);

#endif
