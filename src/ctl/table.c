/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/table.h"
#include "ctl/address.h"
#include "ctl/bus.h"
#include "ctl/events.h"
#include "ctl/history.h"
#include "ctl/jog.h"
#include "ctl/names.h"
#include "ctl/params.h"
#include "ctl/params_restore.h"
#include "ctl/record.h"
#include "ctl/run.h"
#include "ctl/scan.h"
#include "ctl/service.h"
#include "ctl/set.h"
#include "ctl/show.h"
#include "ctl/status.h"
#include "ctl/stop.h"
#include "ctl/trace.h"
#include "ctl/watch.h"

#include <string.h>

/* clang-format off */
const struct db_ctl_command db_ctl_commands[] = {
	{ "status", "", "", 0, 0, true,
	  "All drives and buses, the worst first, and what to do next; ends with 1 when something needs somebody",
	  db_ctl_status },
	{ "show", "DRIVE", "units", 1, 1, true,
	  "All that a drive says of itself and its parameters, with units and names; or the gateway", db_ctl_show },
	{ "get", "DRIVE NAME...", "units registers", 2, -1, true,
	  "Values by the names of their registers, of a drive or of the gateway", db_ctl_get },
	{ "set", "DRIVE NAME=VALUE...", "units writable", 2, -1, true,
	  "Write values; done when the drive has confirmed them", db_ctl_set },
	{ "run", "DRIVE COMMAND [NAME=VALUE...]", "drives commands arguments", 2, -1, true,
	  "Run a command and wait for its end, that of its motion too; Ctrl-C stops the drive", db_ctl_run },
	{ "stop", "[DRIVE...]", "drives", 0, -1, false,
	  "Stop drives at once, all of them when none is named, and say of each whether that is confirmed; ends with 0 only "
	  "when it is of all",
	  db_ctl_stop },
	{ "jog", "DRIVE", "drives", 1, 1, true,
	  "Move a drive while an arrow key is held", db_ctl_jog },
	{ "watch", "[DRIVE...]", "drives", 0, -1, true,
	  "Positions, velocities, states and the buses' load, as they change", db_ctl_watch },
	{ "params list", "DRIVE [FILE]", "drives files", 1, 2, true,
	  "All parameters with units, ranges and defaults; marked what is not as the vendor delivers it, or not as in the file",
	  db_ctl_params_list },
	{ "params save", "DRIVE [FILE]", "drives files", 1, 2, true,
	  "All parameters into a file, DRIVE.params when none is given, - for standard output", db_ctl_params_save },
	{ "params diff", "A B", "drives-or-files drives-or-files", 2, 2, true,
	  "How the parameters of a drive, a file or the defaults (default) differ from those of another; ends with 0 when "
	  "they do not, with 1 when they do, with 2 when that is not known",
	  db_ctl_params_diff },
	{ "params restore", "DRIVE FILE", "drives files -", 2, 2, true,
	  "Write into a drive what a file has otherwise, one after the other, each read back; shows what differs and asks "
	  "first; started again, it goes on where it ended",
	  db_ctl_params_restore },
	{ "bus", "", "", 0, 0, true,
	  "Cycle, jitter, load, errors and round trips", db_ctl_bus },
	{ "scan", "BUS", "buses", 1, 1, true,
	  "Find the drives of a bus: their addresses, who they are, and what to write into the configuration",
	  db_ctl_scan },
	{ "address", "BUS OLD NEW", "buses -", 3, 3, true,
	  "Give the drive at an address another one: looked at before, asked, saved, and looked for afterwards", db_ctl_address },
	{ "baud", "BUS ADDRESS SPEED", "buses -", 3, 3, true,
	  "Set the speed (bit/s) that a drive is to have; all drives of a bus, and its section, must follow", db_ctl_baud },
	{ "events", "", "", 0, 0, true,
	  "What happened lately", db_ctl_events },
	{ "history", "DRIVE", "drives", 1, 1, true,
	  "The last commands that a drive was given, the newest first: what, how it ended, and by whom", db_ctl_history },
	{ "record", "DRIVE.NAME...", "values", 1, -1, true,
	  "Values at the cycle of their bus as CSV, each with the time of its data; from a trigger on, and some time before it",
	  db_ctl_record },
	{ "trace", "[BUS]", "buses", 0, 1, true,
	  "Every frame of a bus in words and bytes, as it goes on or as it was kept", db_ctl_trace },
	{ "traces", "", "", 0, 0, true,
	  "The traces that were kept when a drive was lost, had a fault or did not stop", db_ctl_traces },
	{ "metrics", "", "", 0, 0, true,
	  "Everything that is counted, in the text format of Prometheus", db_ctl_metrics },
	{ "reload", "", "", 0, 0, true,
	  "Let the service read its configuration again", db_ctl_reload },
	{ "check", "[FILE]", "files", 0, 1, false,
	  "Check a configuration file, the service's own when none is given", db_ctl_check },
	{ "names", "KIND [DRIVE [COMMAND]]", "", 1, 3, true, NULL, db_ctl_names },
	{ NULL, NULL, NULL, 0, 0, false, NULL, NULL },
};

const struct db_ctl_option db_ctl_options[] = {
	{ "socket", "PATH", NULL, "The control socket; else DRIVEBRIDGE_SOCKET or " DB_CTL_SOCKET },
	{ "json", NULL, NULL, "Objects for programs instead of text; one a line for what goes on" },
	{ "all", NULL, " show ", "The registers of results, diagnostics and history as well" },
	{ "no-wait", NULL, " run ", "Do not wait for the end of a motion" },
	{ "quick", NULL, " stop ", "The fastest stop that the drives have" },
	{ "disable", NULL, " stop ", "Take the power off the motors; a load may drop" },
	{ "velocity", "V", " jog ", "How fast, in the unit of target_velocity; a tenth of its limit when not given" },
	{ "interval", "MS", " watch ", "Time between two pictures, 200 ms when not given; 0: every cycle" },
	{ "follow", NULL, " events ", "Go on with those to come" },
	{ "yes", NULL, " params restore scan address baud ", "Do not ask" },
	{ "save", NULL, " params restore ", "Run save_parameters afterwards, so that the drive keeps them without power" },
	{ "with-address", NULL, " params restore ", "Also what says where the drive is heard: its address, its bit rate" },
	{ "all-speeds", NULL, " scan ", "At every speed that drives of the family can have, with the bus set aside" },
	{ "kept", "NUMBER", " trace ", "A trace that was kept, of those that traces lists; or last" },
	{ "past", NULL, " trace ", "Begin with the last seconds, which are still remembered" },
	{ "output", "FILE", " trace record ",
	  "Into a file; a trace of CAN as pcapng, of a serial line as text that drivebridge-sim --replay takes" },
	{ "duration", "S", " trace record ", "End after so many seconds, of a record from the trigger on" },
	{ "samples", "N", " record ", "End after so many samples" },
	{ "trigger", "CONDITION", " record ",
	  "Wait until DRIVE.NAME=VALUE (or != > <) becomes true: a state entered, a value crossed, a bit set" },
	{ "before", "S", " record ", "So many seconds before the trigger, 1 when not given" },
	{ "plot", "PICTURE", " record ", "Behind it a picture by gnuplot: terminal, or FILE.svg" },
	{ "addresses", "FIRST-LAST", " scan ", "Only these addresses" },
	{ "speed", "BIT/S", " scan address baud ", "At this speed, with the bus set aside, where it is not the bus's own" },
	{ "help", NULL, NULL, "Print what there is" },
	{ "version", NULL, NULL, "Print the version" },
	{ NULL, NULL, NULL, NULL },
};
/* clang-format on */

bool db_ctl_takes_option(const struct db_ctl_command *command, const struct db_ctl_option *option)
{
	const char *at = option->commands ? strstr(option->commands, command->name) : NULL;

	return !option->commands || (at && at[-1] == ' ' && at[strlen(command->name)] == ' ');
}
