/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/trouble.h"

#include "drivebridge/driver.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* An ordinary stop takes less. */
#define STANDS_LATE (1 * DB_NS_PER_S)

/* In advice {drive}, {bus} and {address} are filled in, and {fault} and {port} by the results of
 * the two functions. */
static const struct {
	const char *name;
	enum db_trouble_need need;
	const char *advice;
} causes[DB_TROUBLE_COUNT] = {
	[DB_TROUBLE_NONE] = { "none", DB_NEED_NOTHING, "" },
	[DB_TROUBLE_PORT] = { "port", DB_NEED_ACT, "the port of bus {bus} is not open{port}" },
	[DB_TROUBLE_ASIDE] = { "aside", DB_NEED_LOOK,
	                       "bus {bus} is out of service for a scan{scan}; it comes back when "
	                       "that has ended" },
	[DB_TROUBLE_NO_ANSWER] = { "no_answer", DB_NEED_ACT,
	                           "check its power, its cable and its address; it comes back by "
	                           "itself" },
	[DB_TROUBLE_NOT_UNDERSTOOD] = { "not_understood", DB_NEED_ACT,
	                                "it answers, but not as documented: check protocol, baud "
	                                "or bit rate and model, and whether another drive has "
	                                "address {address}" },
	[DB_TROUBLE_LATE] = { "late", DB_NEED_ACT,
	                      "its answers come after they were given up: raise drive-latency-ms "
	                      "of bus {bus}{late}" },
	[DB_TROUBLE_DEAF] = { "deaf", DB_NEED_ACT,
	                      "it does not hear what follows its answers at once: raise "
	                      "turnaround-us of bus {bus}" },
	[DB_TROUBLE_TWO_DRIVES] = { "two_drives", DB_NEED_ACT,
	                            "two drives answer at address {address}: disconnect one of "
	                            "them and give it another "
	                            "address; until then neither position can be trusted" },
	[DB_TROUBLE_RUNS_ON] = { "runs_on", DB_NEED_ACT,
	                         "it did not stop when it was told to: take its power off, then "
	                         "look for the cause" },
	[DB_TROUBLE_MUST_STAND] = { "must_stand", DB_NEED_ACT,
	                            "it was told to stop and is not seen to stand; if it moves, "
	                            "take its power off" },
	[DB_TROUBLE_FAULT] = { "fault", DB_NEED_ACT,
	                       "{fault}; then drivebridgectl run {drive} clear_fault" },
	[DB_TROUBLE_WATCHDOG] = { "watchdog", DB_NEED_ACT,
	                          "its client fell silent; when the client is back: drivebridgectl "
	                          "run {drive} clear_fault" },
	[DB_TROUBLE_WARNING] = { "warning", DB_NEED_LOOK,
	                         "it warns: see drivebridgectl show {drive}, and the drive's "
	                         "manual" },
	[DB_TROUBLE_MAY_HAVE_RESTARTED] = { "may_have_restarted", DB_NEED_LOOK,
	                                    "where its position is counted from is not certain: "
	                                    "check its power, then drivebridgectl run {drive} home "
	                                    "(or set_position)" },
	[DB_TROUBLE_ORIGIN_LOST] = { "origin_lost", DB_NEED_LOOK,
	                             "its position means nothing until it is homed or set: "
	                             "drivebridgectl run {drive} "
	                             "home (or set_position)" },
	[DB_TROUBLE_PARAMS_UNSAVED] = { "params_unsaved", DB_NEED_HINT,
	                                "its parameters are not saved and are lost at power-off: "
	                                "drivebridgectl run {drive} "
	                                "save_parameters" },
};

/* By enum db_error. */
static const char *const fault_advice[] = {
	[DB_ERROR_HARDWARE] = "switch it off and on; if it comes back, replace the drive",
	[DB_ERROR_FLASH] = "its saved parameters are not to be trusted; write and save them again",
	[DB_ERROR_ENCODER] = "check for a blocked axis, the load, the current, the encoder cable",
	[DB_ERROR_OVER_TEMPERATURE] = "let it cool; check ventilation and the motor current",
	[DB_ERROR_OVER_CURRENT] = "check the motor cable for a short circuit, and the load",
	[DB_ERROR_VOLTAGE] = "check the drive's power supply",
	[DB_ERROR_INTERRUPTED] = "its emergency stop ended its program; check why",
	[DB_ERROR_UNEXPLAINED_FAULT] =
		"its reason has not been reported yet; is its report of faults turned on?",
};

/* --- causes ----------------------------------------------------------------------------------- */

enum db_trouble_cause db_trouble_of(const struct db_feedback *feedback,
                                    const struct db_trouble_signs *signs)
{
	uint32_t status = feedback->status;

	if (!(status & DB_STATUS_ONLINE)) {
		if (!(feedback->status & DB_STATUS_BUS_UP))
			return signs->aside ? DB_TROUBLE_ASIDE : DB_TROUBLE_PORT;
		return signs->silence == DB_TROUBLE_NONE ? DB_TROUBLE_NO_ANSWER : signs->silence;
	}
	if (feedback->error == DB_ERROR_RUNS_ON)
		return DB_TROUBLE_RUNS_ON;
	if (signs->stands_late)
		return DB_TROUBLE_MUST_STAND;
	if (signs->two_drives)
		return DB_TROUBLE_TWO_DRIVES;
	if (feedback->error >= DB_ERROR_HARDWARE)
		return DB_TROUBLE_FAULT;
	if (signs->latched)
		return DB_TROUBLE_WATCHDOG;
	if (status & DB_STATUS_WARNING)
		return DB_TROUBLE_WARNING;
	if (feedback->doubt != DB_DOUBT_NONE)
		return DB_TROUBLE_MAY_HAVE_RESTARTED;
	if (status & DB_STATUS_ORIGIN_LOST)
		return DB_TROUBLE_ORIGIN_LOST;
	if (status & DB_STATUS_PARAMS_UNSAVED)
		return DB_TROUBLE_PARAMS_UNSAVED;
	return DB_TROUBLE_NONE;
}

bool db_trouble_stands_late(const struct db_must_stand *must_stand, db_time now)
{
	return must_stand->cause != DB_STAND_FREE && now - must_stand->since > STANDS_LATE;
}

/* --- texts ------------------------------------------------------------------------------------ */

const char *db_trouble_name(unsigned cause)
{
	return cause < DB_TROUBLE_COUNT ? causes[cause].name : "unknown";
}

enum db_trouble_need db_trouble_need(enum db_trouble_cause cause)
{
	return (size_t)cause < DB_TROUBLE_COUNT ? causes[cause].need : DB_NEED_ACT;
}

const char *db_trouble_need_name(enum db_trouble_need need)
{
	static const char *const names[] = { "nothing", "hint", "look", "act" };

	return (size_t)need < COUNT_OF(names) ? names[need] : "act";
}

const char *db_trouble_fault_advice(const struct db_driver *driver, uint16_t error)
{
	const struct db_drive_fault *fault = driver ? db_driver_fault(driver, error) : NULL;

	if (fault)
		return fault->check;
	return error < COUNT_OF(fault_advice) && fault_advice[error] ? fault_advice[error] :
	                                                               "see the drive's manual";
}

static const char *find_port_advice(bool serial, int error)
{
	switch (error) {
	case ENOENT:
	case ENODEV:
	case ENXIO:
		return "; is it plugged in, and is its name right?";
	case EACCES:
	case EPERM:
		return "; may this user open it (group dialout)?";
	case ENOTTY:
		return "; its driver cannot switch RS485 with RTS: leave direction = adapter";
	case EBUSY:
		return "; another program uses it";
	case EAFNOSUPPORT:
		return "; this kernel has no CAN";
	case ETIMEDOUT:
		return "; the adapter does not answer: does it speak SLCAN, and is baud right?";
	case EPROTO:
		return "; the adapter refuses to open the bus";
	case ENETDOWN:
		return "; the interface is down: set it up with its bit rate (systemd-networkd)";
	case ENOBUFS:
		if (serial)
			return "; it takes no bytes: unplug the adapter and plug it in again, and "
			       "check its flow control";
		return "; nobody on the bus acknowledges: check wiring, termination, bit rate and "
		       "the drives' power";
	default:
		return "";
	}
}

void db_trouble_port_advice(bool serial, int error, const char *device, const char *holder,
                            char text[DB_TROUBLE_ADVICE_MAX])
{
	if (error == EBUSY && holder && holder[0])
		snprintf(text, DB_TROUBLE_ADVICE_MAX, "; %s has it: end that", holder);
	else if (error == EBUSY && device)
		snprintf(text, DB_TROUBLE_ADVICE_MAX,
		         "; another program has it: sudo fuser -v %.200s says which", device);
	else
		snprintf(text, DB_TROUBLE_ADVICE_MAX, "%s", find_port_advice(serial, error));
}

/* The text for a word between braces, of `length` characters; written into `number` where it is a
 * number. */
static const char *find_filling(const struct db_trouble_about *about, const char *word,
                                size_t length, char *number, size_t size)
{
	const char *filling = "";

	if (strncmp(word, "{drive}", length) == 0)
		filling = about->drive;
	else if (strncmp(word, "{bus}", length) == 0)
		filling = about->bus;
	else if (strncmp(word, "{scan}", length) == 0 && about->scan && about->scan[0])
		snprintf(number, size, " of %s", about->scan);
	else if (strncmp(word, "{port}", length) == 0)
		filling = about->port_advice && about->port_advice[0] ?
		                  about->port_advice :
		                  ": check the adapter and its cable";
	else if (strncmp(word, "{fault}", length) == 0)
		filling = db_trouble_fault_advice(about->driver, about->error);
	else if (strncmp(word, "{address}", length) == 0)
		snprintf(number, size, "%u", about->address);
	else if (strncmp(word, "{late}", length) == 0 && about->late_ms > 0)
		snprintf(number, size, " to %u", about->late_ms + about->late_ms / 2);
	if (!filling)
		return "";
	return number[0] ? number : filling;
}

void db_trouble_advice(enum db_trouble_cause cause, const struct db_trouble_about *about,
                       char text[DB_TROUBLE_ADVICE_MAX])
{
	const char *format = (size_t)cause < DB_TROUBLE_COUNT ? causes[cause].advice : "";
	size_t used = 0;

	while (*format && used < DB_TROUBLE_ADVICE_MAX - 1) {
		const char *end = *format == '{' ? strchr(format, '}') : NULL;
		char number[160] = "";

		if (!end) {
			text[used++] = *format++;
			continue;
		}
		used += (size_t)snprintf(text + used, DB_TROUBLE_ADVICE_MAX - used, "%s",
		                         find_filling(about, format, (size_t)(end - format) + 1,
		                                      number, sizeof(number)));
		format = end + 1;
	}
	text[used < DB_TROUBLE_ADVICE_MAX ? used : DB_TROUBLE_ADVICE_MAX - 1] = '\0';
}
