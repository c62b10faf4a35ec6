/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on RS232 and RS485. Every command is answered by exactly one frame, whose status
 * word tells whether the drive took it (cmd_wrg); that answer is the confirmation.
 *
 * A relative move is turned into an absolute one from a freshly read position, so that a lost answer
 * can never make the drive move twice. Commands that start a motion are not repeated blindly
 * either: after a lost answer the drive is read back, and only when it demonstrably did not react
 * (it stood and still stands where it was) is the command sent again.
 *
 * Source: VSMD custom protocol for RS232 & RS485, sections 2 and 3.
 */
#include "codec/vsmd_serial.h"
#include "driver/list.h"
#include "transport/serial.h"

#include <math.h>
#include <string.h>

/* Answers the document gives no length for: identity text, and all parameters as text. */
#define IDENTITY_FRAME 64
#define PARAMS_FRAME 1000

/* What a drive usually needs before it starts to answer; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* Writing the flash: beyond the latency that other commands are given. */
#define SAVE_TIME (500 * DB_NS_PER_MS)

/* Homing stands still for a moment between its phases; standing longer than this many polls means
 * that it ended without reaching its end. */
#define HOMING_STANDSTILL_POLLS 25

#define RESENDS_MAX 2

enum motion { MOTION_NONE, MOTION_DISCRETE, MOTION_CONTINUOUS, MOTION_HOMING, MOTION_SHAKE };

struct db_device {
	int id;
	db_time save_interval;
	db_time last_save;
	bool saved;

	struct vsmd_status last;
	db_time taken;   /* when `last` came */
	bool heard;      /* `last` holds something */
	bool handshaken; /* hs was seen set: when it drops, the drive has restarted */
	enum motion motion;
	bool fresh; /* motion accepted, no status read after it yet */
	bool stopping;
	bool homed;
	bool origin_lost;
	bool refused;
	bool has_target;
	int32_t target;
	unsigned standstill_polls;
	struct db_nameplate plate;
	bool params_valid;
};

/* Where a conversation is. FIRST is the command itself (or its preparation). */
enum step { STEP_FIRST, STEP_SECOND, STEP_THIRD, STEP_READ_BACK };

/* scratch[0] of a motion command: where the drive stood. scratch[1]: these. */
#define WAS_MOVING 1
#define RESENDS_SHIFT 8

/* --- exchanges ------------------------------------------------------------------------------- */

static enum db_step ask(const struct db_device *device, struct vsmd_command command,
                        bool repeatable, struct db_exchange *exchange, enum db_result *result)
{
	int length;

	command.id = device->id;
	length = vsmd_serial_encode_command(&command, (char *)exchange->request,
	                                    exchange->request_size);
	if (length < 0) {
		*result = DB_RESULT_OUT_OF_RANGE;
		return DB_STEP_DONE;
	}
	exchange->request_length = (size_t)length;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	switch (command.verb) {
	case VSMD_DEV:
		exchange->answer_length = IDENTITY_FRAME;
		break;
	case VSMD_SAV:
		exchange->extra_time = SAVE_TIME;
		exchange->answer_length = PARAMS_FRAME;
		break;
	case VSMD_CFG_READ:
		exchange->answer_length = PARAMS_FRAME;
		break;
	default:
		exchange->answer_length = VSMD_SERIAL_STATUS_FRAME;
		break;
	}
	return DB_STEP_SEND;
}

static enum db_step ask_verb(const struct db_device *device, enum vsmd_verb verb,
                             struct db_exchange *exchange, enum db_result *result)
{
	return ask(device, (struct vsmd_command){ .verb = verb }, true, exchange, result);
}

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

/* --- what a command looks like on this bus ----------------------------------------------------- */

/* True when after a lost answer the drive must be read back before anything else is done. */
static bool needs_read_back(enum db_command command)
{
	return db_command_is_motion(command) || command == DB_CMD_SET_POSITION;
}

static struct vsmd_command position_command(int32_t target, float velocity)
{
	return (struct vsmd_command){
		.verb = VSMD_POS,
		.position = target,
		.has_velocity = velocity > 0.0f,
		.velocity = velocity,
	};
}

static struct vsmd_command shake_command(enum vsmd_verb verb, const struct db_args *args,
                                         uint32_t count)
{
	return (struct vsmd_command){
		.verb = verb,
		.shake_start = args->shake_start_position,
		.shake_end = args->shake_end_position,
		.shake_frequency = args->shake_frequency,
		.shake_count = count,
	};
}

/* The line that carries a command out, where one line does. */
static struct vsmd_command line_of(enum db_command command, const struct db_args *args)
{
	switch (command) {
	case DB_CMD_ENABLE:
		return (struct vsmd_command){ .verb = VSMD_ENA };
	case DB_CMD_DISABLE:
		return (struct vsmd_command){ .verb = VSMD_OFF };
	case DB_CMD_STOP:
		return (struct vsmd_command){ .verb = VSMD_STP };
	case DB_CMD_QUICK_STOP:
		return (struct vsmd_command){ .verb = VSMD_STP, .has_value = true, .value = 1 };
	case DB_CMD_MOVE_VELOCITY:
		return (struct vsmd_command){ .verb = VSMD_MOV,
			                      .has_velocity = true,
			                      .velocity = args->target_velocity };
	case DB_CMD_MOVE_PRESET:
		return (struct vsmd_command){ .verb = VSMD_MOV };
	case DB_CMD_MOVE_ABSOLUTE:
		return position_command(args->target_position, args->target_velocity);
	case DB_CMD_HOME:
	case DB_CMD_HOME_STOP:
		return (struct vsmd_command){ .verb = VSMD_ZERO_STOP };
	case DB_CMD_SET_POSITION:
		return (struct vsmd_command){ .verb = VSMD_ORG,
			                      .has_value = true,
			                      .position = args->target_position };
	case DB_CMD_CLEAR_FAULT:
		return (struct vsmd_command){ .verb = VSMD_ECLR };
	case DB_CMD_SAVE_PARAMETERS:
		return (struct vsmd_command){ .verb = VSMD_SAV };
	case DB_CMD_READ_PARAMETERS:
		return (struct vsmd_command){ .verb = VSMD_DEV };
	case DB_CMD_SET_OUTPUT:
		return (struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SET_SV:
		return (struct vsmd_command){ .verb = VSMD_SV,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SET_NMOS:
		return (struct vsmd_command){ .verb = VSMD_NMOS,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SHAKE_START:
		return shake_command(VSMD_SHAKE_CYCLES, args, args->shake_cycles);
	case DB_CMD_SHAKE_START_TIME:
		return shake_command(VSMD_SHAKE_TIME, args, args->shake_time);
	case DB_CMD_SHAKE_STOP:
		return (struct vsmd_command){ .verb = VSMD_SHAKE_STOP };
	default: /* relative moves, and anything check() refuses, begin by reading the status */
		return (struct vsmd_command){ .verb = VSMD_STS };
	}
}

static bool in(double value, double min, double max)
{
	return value >= min && value <= max;
}

static bool port_and_value(const struct db_args *args, unsigned ports, unsigned max)
{
	return in(args->output_number, 1, ports) && args->output_value <= max;
}

static enum db_result vsmd_check(const struct db_bus_config *bus,
                                 const struct db_drive_config *drive, enum db_command command,
                                 const struct db_args *args)
{
	bool right = true;

	(void)bus;
	(void)drive;

	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
		right = in((double)args->target_velocity, -VSMD_SPEED_MAX, VSMD_SPEED_MAX);
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		right = in((double)args->target_velocity, 0.0, VSMD_SPEED_MAX);
		break;
	case DB_CMD_SET_OUTPUT:
		right = port_and_value(args, 6, 1);
		break;
	case DB_CMD_SET_OUTPUTS:
		right = args->output_mask != 0 && args->output_mask < 1u << 6;
		break;
	case DB_CMD_SET_SV:
	case DB_CMD_SET_NMOS:
		right = port_and_value(args, 3, 255);
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		right = in((double)args->shake_frequency, (double)VSMD_SHAKE_FREQ_MIN,
		           (double)VSMD_SHAKE_FREQ_MAX) &&
		        args->shake_cycles <= INT32_MAX && args->shake_time <= INT32_MAX;
		break;
	default:
		if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
		    !(db_driver_vsmd_serial.commands & DB_COMMAND_BIT(command)))
			return DB_RESULT_UNSUPPORTED;
		break;
	}
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

static enum db_result vsmd_check_param(const struct db_bus_config *bus, size_t param,
                                       union db_value value)
{
	(void)bus;
	if (param >= VSMD_PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
	return vsmd_param_in_range((enum vsmd_param)param, value) ? DB_RESULT_OK :
	                                                            DB_RESULT_OUT_OF_RANGE;
}

/* --- beginning a job --------------------------------------------------------------------------- */

/* The next port of a set_outputs, from `port` on; 0 when there is none. */
static unsigned next_output(const struct db_args *args, unsigned port)
{
	for (; port <= 6; port++) {
		if (args->output_mask & (1u << (port - 1)))
			return port;
	}
	return 0;
}

static enum db_step send_output(const struct db_device *device, struct db_job *job, unsigned port,
                                struct db_exchange *exchange, enum db_result *result)
{
	const struct db_args *args = &job->request->args;

	port = next_output(args, port);
	if (port == 0)
		return done(result, DB_RESULT_OK);
	job->step = port;
	return ask(device,
	           (struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
	                                  .port = (uint8_t)port,
	                                  .value = (args->output_levels >> (port - 1)) & 1 },
	           true, exchange, result);
}

static enum db_step begin_command(struct db_device *device, struct db_job *job,
                                  struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;
	bool repeatable = !needs_read_back(command) || command == DB_CMD_MOVE_RELATIVE ||
	                  command == DB_CMD_HOME;

	if (command == DB_CMD_SET_OUTPUTS)
		return send_output(device, job, 1, exchange, result);
	if (command == DB_CMD_SAVE_PARAMETERS) {
		if (device->saved && job->started - device->last_save < device->save_interval)
			return done(result, DB_RESULT_RATE_LIMITED);
		device->saved = true;
		device->last_save = job->started;
		repeatable = false;
	}
	job->scratch[0] = device->last.position;
	job->scratch[1] = device->last.status & VSMD_ST_STP ? 0 : WAS_MOVING;
	return ask(device, line_of(command, &job->request->args), repeatable, exchange, result);
}

static enum db_step begin_settings(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_setting settings[DB_SETTINGS_MAX];

	for (size_t i = 0; i < job->request->setting_count; i++) {
		settings[i].param = (enum vsmd_param)job->request->settings[i].param;
		settings[i].value = job->request->settings[i].value;
	}
	return ask(device,
	           (struct vsmd_command){ .verb = VSMD_CFG_WRITE,
	                                  .settings = settings,
	                                  .setting_count = job->request->setting_count },
	           true, exchange, result);
}

static enum db_step vsmd_begin(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	job->step = STEP_FIRST;
	switch (job->kind) {
	case DB_JOB_PROBE:
	case DB_JOB_IDENTIFY:
		return ask_verb(device, VSMD_DEV, exchange, result);
	case DB_JOB_POLL:
		return ask_verb(device, VSMD_STS, exchange, result);
	case DB_JOB_SETTINGS:
		return begin_settings(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return begin_command(device, job, exchange, result);
	}
}

/* --- what the answers teach -------------------------------------------------------------------- */

static void forget_motion(struct db_device *device)
{
	device->motion = MOTION_NONE;
	device->fresh = false;
	device->stopping = false;
	device->standstill_polls = 0;
}

static void take_identity(struct db_device *device, const struct vsmd_reply *reply)
{
	size_t length = reply->text_length;
	char text[DB_IDENTITY_MAX] = { 0 };

	/* The document's samples carry the text in quotation marks, drives send it without. */
	if (length >= 2 && reply->text[0] == '"' && reply->text[length - 1] == '"') {
		memcpy(text, reply->text + 1, length - 2 < sizeof text ? length - 2 : sizeof text);
	} else {
		memcpy(text, reply->text, length < sizeof text ? length : sizeof text);
	}
	if (memcmp(text, device->plate.identity, sizeof text) != 0) {
		memcpy(device->plate.identity, text, sizeof text);
		device->plate.generation++;
	}
}

static void take_params(struct db_device *device, const struct vsmd_reply *reply)
{
	struct vsmd_setting setting;
	size_t cursor = 0;
	int found;

	device->plate.valid = 0;
	while ((found = vsmd_serial_next_param(reply->text, reply->text_length, &cursor,
	                                       &setting)) != 0) {
		if (found != 1)
			continue;
		device->plate.values[setting.param] = setting.value;
		device->plate.valid |= UINT64_C(1) << setting.param;
	}
	device->plate.generation++;
	device->plate.doubtful = false;
	device->params_valid = true;
}

/* A poll is the only status that is certainly younger than the last command. */
static void follow_motion(struct db_device *device)
{
	uint32_t status = device->last.status;

	device->fresh = false;
	if (!(status & VSMD_ST_STP)) {
		device->standstill_polls = 0;
		return;
	}
	device->stopping = false;
	if (device->motion != MOTION_HOMING) {
		device->motion = MOTION_NONE;
	} else if (status & VSMD_ST_ZERO) {
		device->homed = true;
		device->origin_lost = false;
		forget_motion(device);
	} else if (++device->standstill_polls > HOMING_STANDSTILL_POLLS) {
		forget_motion(device);
	}
}

static void take_status(struct db_device *device, const struct vsmd_status *status, db_time now)
{
	bool hs = (status->status & VSMD_ST_HS) != 0;

	if (device->handshaken && !hs) {
		/* It lost power between two polls: what it was told before is gone. */
		forget_motion(device);
		device->homed = false;
		device->origin_lost = true;
		device->has_target = false;
		device->params_valid = false;
	}
	device->handshaken = hs;
	device->last = *status;
	device->taken = now;
	device->heard = true;
}

static void start_motion(struct db_device *device, enum motion motion)
{
	device->motion = motion;
	device->fresh = true;
	device->stopping = false;
	device->standstill_polls = 0;
	if (motion != MOTION_DISCRETE)
		device->has_target = false;
}

static void stop_motion(struct db_device *device)
{
	if (device->motion != MOTION_NONE || !(device->last.status & VSMD_ST_STP)) {
		device->stopping = true;
		device->fresh = true;
	}
	device->has_target = false;
}

/* The drive confirmed a command: what that means for the axis. */
static void carried_out(struct db_device *device, const struct db_job *job)
{
	const struct db_args *args = &job->request->args;

	switch (job->request->command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_PRESET:
		start_motion(device, MOTION_CONTINUOUS);
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		start_motion(device, MOTION_DISCRETE);
		break;
	case DB_CMD_HOME:
		device->homed = false;
		start_motion(device, MOTION_HOMING);
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		start_motion(device, MOTION_SHAKE);
		break;
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
	case DB_CMD_HOME_STOP:
	case DB_CMD_SHAKE_STOP:
		stop_motion(device);
		break;
	case DB_CMD_SET_POSITION:
		device->origin_lost = false;
		device->has_target = false;
		device->last.position = args->target_position;
		break;
	case DB_CMD_DISABLE: /* section 2.4.3: the position becomes 0, the origin is lost */
		forget_motion(device);
		device->homed = false;
		device->origin_lost = true;
		device->has_target = false;
		break;
	default:
		break;
	}
}

/* --- answers ----------------------------------------------------------------------------------- */

static enum db_step confirmed(struct db_device *device, const struct db_job *job,
                              enum db_result *result)
{
	carried_out(device, job);
	return done(result, DB_RESULT_OK);
}

/* Has the power stage followed enable or disable? It may be a status too early in the answer. */
static enum db_step check_power(struct db_device *device, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	bool wanted = job->request->command == DB_CMD_ENABLE;
	bool powered = (device->last.status & VSMD_ST_PWR) != 0;

	if (powered == wanted)
		return confirmed(device, job, result);
	if (job->step < STEP_THIRD) {
		job->step++;
		return ask_verb(device, VSMD_STS, exchange, result);
	}
	return done(result, DB_RESULT_FAILED);
}

/* `stp` is documented for the velocity and position modes; homing and shaking have their own ends. */
static enum db_step after_stop(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == STEP_FIRST && device->motion == MOTION_HOMING) {
		job->step = STEP_SECOND;
		return ask_verb(device, VSMD_ZERO_STOP, exchange, result);
	}
	if (job->step == STEP_FIRST && device->motion == MOTION_SHAKE) {
		job->step = STEP_SECOND;
		return ask_verb(device, VSMD_SHAKE_STOP, exchange, result);
	}
	return confirmed(device, job, result);
}

static enum db_step send_target(struct db_device *device, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	job->step = STEP_SECOND;
	device->has_target = true;
	return ask(device, position_command(device->target, job->request->args.target_velocity),
	           false, exchange, result);
}

static enum db_step after_relative(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	int64_t target;

	if (job->step != STEP_FIRST)
		return confirmed(device, job, result);
	target = (int64_t)device->last.position + job->request->args.target_position;
	if (target < INT32_MIN || target > INT32_MAX)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	device->target = (int32_t)target;
	job->scratch[0] = device->last.position;
	job->scratch[1] = device->last.status & VSMD_ST_STP ? 0 : WAS_MOVING;
	return send_target(device, job, exchange, result);
}

/* Sends a motion command again that the drive demonstrably did not receive. */
static enum db_step resend(struct db_device *device, struct db_job *job,
                           struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;

	if (job->scratch[1] >> RESENDS_SHIFT >= RESENDS_MAX)
		return done(result, DB_RESULT_TIMEOUT);
	job->scratch[1] += 1 << RESENDS_SHIFT;
	if (command == DB_CMD_MOVE_RELATIVE)
		return send_target(device, job, exchange, result);
	job->step = command == DB_CMD_HOME ? STEP_SECOND : STEP_FIRST;
	if (command == DB_CMD_HOME)
		return ask(device, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false,
		           exchange, result);
	return ask(device, line_of(command, &job->request->args), false, exchange, result);
}

/* The answer to a motion command or set_position was lost: what does the drive itself say? */
static enum db_step resolve(struct db_device *device, struct db_job *job,
                            struct db_exchange *exchange, enum db_result *result)
{
	const struct vsmd_status *now = &device->last;
	enum db_command command = job->request->command;
	bool positions = command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE;
	bool stands = (now->status & VSMD_ST_STP) != 0;
	bool stood = !(job->scratch[1] & WAS_MOVING);
	bool unmoved = stood && stands && now->position == job->scratch[0];

	if (unmoved && (now->status & VSMD_ST_CMD_WRG))
		return done(result, DB_RESULT_REFUSED);
	if (command == DB_CMD_SET_POSITION) {
		if (stands && now->position == job->request->args.target_position)
			return confirmed(device, job, result);
		return unmoved ? resend(device, job, exchange, result) :
		                 done(result, DB_RESULT_INDETERMINATE);
	}
	if (positions && stands && now->position == device->target)
		return confirmed(device, job, result);
	if (stood && !stands)
		return confirmed(device, job, result);
	if (command == DB_CMD_HOME && (now->status & VSMD_ST_ZERO))
		return confirmed(device, job, result);
	if (unmoved)
		return resend(device, job, exchange, result);
	/* It moved before and moves still: the same target or speed once more changes nothing. */
	if (!stood && !stands &&
	    (positions || command == DB_CMD_MOVE_VELOCITY || command == DB_CMD_MOVE_PRESET))
		return resend(device, job, exchange, result);
	return done(result, DB_RESULT_INDETERMINATE);
}

static enum db_step answer_command(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;

	if (job->step == STEP_READ_BACK && needs_read_back(command))
		return resolve(device, job, exchange, result);
	device->refused = (device->last.status & VSMD_ST_CMD_WRG) != 0;
	/* A status read inside a conversation shows the flag of the command before it. */
	if (device->refused && !(command == DB_CMD_MOVE_RELATIVE && job->step == STEP_FIRST))
		return done(result, DB_RESULT_REFUSED);
	switch (command) {
	case DB_CMD_ENABLE:
	case DB_CMD_DISABLE:
		return check_power(device, job, exchange, result);
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return after_stop(device, job, exchange, result);
	case DB_CMD_MOVE_RELATIVE:
		return after_relative(device, job, exchange, result);
	case DB_CMD_MOVE_ABSOLUTE:
		device->target = job->request->args.target_position;
		device->has_target = true;
		return confirmed(device, job, result);
	case DB_CMD_HOME:
		if (job->step == STEP_FIRST) {
			job->step = STEP_SECOND;
			return ask(device, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false,
			           exchange, result);
		}
		return confirmed(device, job, result);
	case DB_CMD_SET_OUTPUTS:
		return send_output(device, job, job->step + 1, exchange, result);
	default:
		return confirmed(device, job, result);
	}
}

static enum db_step answer_settings(struct db_device *device, const struct db_job *job,
                                    enum db_result *result)
{
	device->refused = (device->last.status & VSMD_ST_CMD_WRG) != 0;
	if (device->refused) {
		/* Which of several settings it took is unknown: read all of them again. */
		device->plate.doubtful = true;
		return done(result, DB_RESULT_REFUSED);
	}
	for (size_t i = 0; i < job->request->setting_count; i++) {
		const struct db_setting *setting = &job->request->settings[i];

		device->plate.values[setting->param] = setting->value;
		device->plate.valid |= UINT64_C(1) << setting->param;
	}
	device->plate.generation++;
	return done(result, DB_RESULT_OK);
}

static enum db_step answer_identify(struct db_device *device, struct db_job *job,
                                    const struct vsmd_reply *reply, struct db_exchange *exchange,
                                    enum db_result *result)
{
	if (job->step == STEP_FIRST) {
		take_identity(device, reply);
		job->step = STEP_SECOND;
		return ask_verb(device, VSMD_CFG_READ, exchange, result);
	}
	take_params(device, reply);
	return done(result, DB_RESULT_OK);
}

static enum db_step answer_save(struct db_device *device, const struct vsmd_reply *reply,
                                enum db_result *result)
{
	if (reply->code == VSMD_REPLY_PARAMS) {
		take_params(device, reply);
		return done(result, DB_RESULT_OK);
	}
	return done(result, reply->status.status & VSMD_ST_FLASH_ERR ? DB_RESULT_FAILED :
	                                                               DB_RESULT_REFUSED);
}

/* Which reply code the exchange on the wire must bring. */
static bool expected(const struct db_job *job, enum vsmd_reply_code code)
{
	enum db_command command = job->request ? job->request->command : DB_CMD_NONE;

	switch (job->kind) {
	case DB_JOB_PROBE:
		return code == VSMD_REPLY_IDENTITY;
	case DB_JOB_COMMAND:
		if (command == DB_CMD_SAVE_PARAMETERS)
			return code == VSMD_REPLY_PARAMS || code == VSMD_REPLY_STATUS;
		if (command != DB_CMD_READ_PARAMETERS)
			return code == VSMD_REPLY_STATUS;
		/* fall through */
	case DB_JOB_IDENTIFY:
		return code == (job->step == STEP_FIRST ? VSMD_REPLY_IDENTITY : VSMD_REPLY_PARAMS);
	default:
		return code == VSMD_REPLY_STATUS;
	}
}

static enum db_step vsmd_answer(struct db_device *device, struct db_job *job, const uint8_t *frame,
                                size_t length, db_time now, struct db_exchange *exchange,
                                enum db_result *result)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK ||
	    !expected(job, reply.code))
		return DB_STEP_IGNORE;
	if (reply.code == VSMD_REPLY_STATUS)
		take_status(device, &reply.status, now);
	switch (job->kind) {
	case DB_JOB_PROBE:
		take_identity(device, &reply);
		return done(result, DB_RESULT_OK);
	case DB_JOB_IDENTIFY:
		return answer_identify(device, job, &reply, exchange, result);
	case DB_JOB_POLL:
		follow_motion(device);
		return done(result, DB_RESULT_OK);
	case DB_JOB_SETTINGS:
		return answer_settings(device, job, result);
	case DB_JOB_COMMAND:
	default:
		if (job->request->command == DB_CMD_READ_PARAMETERS)
			return answer_identify(device, job, &reply, exchange, result);
		if (job->request->command == DB_CMD_SAVE_PARAMETERS)
			return answer_save(device, &reply, result);
		return answer_command(device, job, exchange, result);
	}
}

static enum db_step vsmd_lost(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request ? job->request->command : DB_CMD_NONE;
	bool reading;

	if (job->kind == DB_JOB_SETTINGS)
		device->plate.doubtful = true;
	if (job->kind != DB_JOB_COMMAND)
		return done(result, DB_RESULT_TIMEOUT);
	if (command == DB_CMD_SAVE_PARAMETERS)
		return done(result, DB_RESULT_INDETERMINATE);
	if (!needs_read_back(command))
		return done(result, DB_RESULT_TIMEOUT);
	/* The preparation of a relative move or a homing run has not moved anything. */
	reading = job->step == STEP_FIRST &&
	          (command == DB_CMD_MOVE_RELATIVE || command == DB_CMD_HOME);
	if (reading)
		return done(result, DB_RESULT_TIMEOUT);
	if (job->step == STEP_READ_BACK)
		return done(result, DB_RESULT_INDETERMINATE);
	if (command == DB_CMD_MOVE_ABSOLUTE) {
		device->target = job->request->args.target_position;
		device->has_target = true;
	}
	job->step = STEP_READ_BACK;
	return ask_verb(device, VSMD_STS, exchange, result);
}

/* --- state ------------------------------------------------------------------------------------- */

static uint16_t inputs_of(uint32_t status)
{
	return (uint16_t)((status & 0xFu) | ((status >> 12) & 0x30u));
}

static uint16_t outputs_of(const struct db_device *device, uint16_t levels)
{
	uint16_t outputs = 0;

	for (unsigned i = 0; i < 6; i++) {
		if ((device->plate.valid >> (VSMD_S1 + i) & 1) &&
		    device->plate.values[VSMD_S1 + i].u == 1)
			outputs |= (uint16_t)(1u << i);
	}
	return outputs & levels;
}

static uint16_t error_of(uint32_t status)
{
	if (status & VSMD_ST_ENC_ERR)
		return DB_ERROR_ENCODER;
	if (status & VSMD_ST_OVER_CURRENT)
		return DB_ERROR_OVER_CURRENT;
	if (status & VSMD_ST_OVER_TEMPERATURE)
		return DB_ERROR_OVER_TEMPERATURE;
	if (status & VSMD_ST_VOLTAGE)
		return DB_ERROR_VOLTAGE;
	if (status & VSMD_ST_FLT)
		return DB_ERROR_HARDWARE;
	if (status & VSMD_ST_FLASH_ERR)
		return DB_ERROR_FLASH;
	return DB_ERROR_NONE;
}

static enum db_axis_state state_of(const struct db_device *device, uint16_t error)
{
	bool moving = !(device->last.status & VSMD_ST_STP) || device->fresh;

	if (error != DB_ERROR_NONE && error != DB_ERROR_FLASH)
		return DB_AXIS_ERROR_STOP;
	if (!(device->last.status & VSMD_ST_PWR))
		return DB_AXIS_DISABLED;
	if (device->motion == MOTION_HOMING && !device->stopping)
		return DB_AXIS_HOMING;
	if (!moving)
		return DB_AXIS_STANDSTILL;
	if (device->stopping)
		return DB_AXIS_STOPPING;
	return device->motion == MOTION_DISCRETE ? DB_AXIS_DISCRETE_MOTION :
	                                           DB_AXIS_CONTINUOUS_MOTION;
}

static uint32_t status_of(const struct db_device *device, enum db_axis_state state, uint16_t error)
{
	uint32_t drive = device->last.status;
	bool stands = (drive & VSMD_ST_STP) && !device->fresh;
	uint32_t status = 0;

	if (drive & VSMD_ST_PWR)
		status |= DB_STATUS_ENABLED;
	if (device->homed)
		status |= DB_STATUS_HOMED;
	if (!stands)
		status |= DB_STATUS_MOVING;
	if (stands && device->has_target && device->last.position == device->target)
		status |= DB_STATUS_AT_TARGET;
	if (state == DB_AXIS_HOMING)
		status |= DB_STATUS_HOMING;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (error == DB_ERROR_FLASH)
		status |= DB_STATUS_WARNING;
	if (device->origin_lost)
		status |= DB_STATUS_ORIGIN_LOST;
	if (device->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (device->refused)
		status |= DB_STATUS_REFUSED;
	return status;
}

static void vsmd_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	enum db_axis_state state;

	feedback->taken = device->taken;
	feedback->position = device->last.position;
	feedback->velocity = device->last.velocity;
	feedback->drive_status = device->last.status;
	feedback->inputs = inputs_of(device->last.status);
	feedback->outputs = outputs_of(device, feedback->inputs);
	feedback->error = error_of(device->last.status);
	state = device->heard ? state_of(device, feedback->error) : DB_AXIS_OFFLINE;
	feedback->state = (uint16_t)state;
	feedback->status = status_of(device, state, feedback->error);
}

static void vsmd_gone(struct db_device *device)
{
	device->params_valid = false;
	device->heard = false;
	device->fresh = false;
}

static const struct db_nameplate *vsmd_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static void vsmd_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive an address */
	device->id = bus->line == DB_LINE_RS232 ? VSMD_SERIAL_NO_ID : (int)drive->address;
	device->save_interval = (db_time)bus->save_interval_s * DB_NS_PER_S;
}

/* --- the bus's side ---------------------------------------------------------------------------- */

static void vsmd_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	*length = 0;
	if (vsmd_serial_cut(bytes, available, skip, length) != VSMD_CUT_FRAME)
		*length = 0;
}

static enum db_frame vsmd_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_FRAME_BAD;
	/* On RS232 there is one drive, and what id it gives differs. */
	*address = bus->line == DB_LINE_RS232 ? -1 : reply.id;
	return DB_FRAME_GOOD;
}

static db_time time_of(const struct db_bus_config *bus, size_t request, size_t answer)
{
	return db_serial_wire_time(bus, request + answer) + TYPICAL_LATENCY;
}

static db_time vsmd_poll_time(const struct db_bus_config *bus)
{
	return time_of(bus, strlen("32 sts\n"), VSMD_SERIAL_STATUS_FRAME);
}

static db_time vsmd_command_time(const struct db_bus_config *bus)
{
	return time_of(bus, strlen("32 pos -2147483648 spd=192000.5\n"), VSMD_SERIAL_STATUS_FRAME);
}

static bool vsmd_broadcast(enum db_command command, const struct db_bus_config *bus,
                           struct db_exchange *exchange)
{
	struct db_device everyone = { .id = VSMD_SERIAL_BROADCAST };
	const struct db_args none = { 0 };
	enum db_result result;

	if (bus->line != DB_LINE_RS485 ||
	    !(db_command_is_stop(command) || command == DB_CMD_ENABLE))
		return false;
	if (ask(&everyone, line_of(command, &none), false, exchange, &result) != DB_STEP_SEND)
		return false;
	exchange->answer_length = 0;
	return true;
}

#define COMMANDS                                                                        \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |               \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |              \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) |  \
	 DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE) | DB_COMMAND_BIT(DB_CMD_HOME) |           \
	 DB_COMMAND_BIT(DB_CMD_HOME_STOP) | DB_COMMAND_BIT(DB_CMD_SET_POSITION) |       \
	 DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS) |  \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_MOVE_PRESET) |  \
	 DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS) |       \
	 DB_COMMAND_BIT(DB_CMD_SET_SV) | DB_COMMAND_BIT(DB_CMD_SET_NMOS) |              \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_START) | DB_COMMAND_BIT(DB_CMD_SHAKE_START_TIME) | \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_STOP))

const struct db_driver db_driver_vsmd_serial = {
	.name = "vsmd-serial",
	.title = "VSMD stepper on RS485 or RS232",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = VSMD_SERIAL_ID_MAX,
	.default_baud = 9600,
	.commands = COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS,
	.output_count = 6,
	.params = vsmd_params,
	.param_count = VSMD_PARAM_COUNT,
	.param_page = 0,
	.acceleration_param = VSMD_ACC,
	.deceleration_param = VSMD_DEC,
	.check = vsmd_check,
	.check_param = vsmd_check_param,
	.poll_time = vsmd_poll_time,
	.command_time = vsmd_command_time,
	.device_size = sizeof(struct db_device),
	.init = vsmd_init,
	.cut = vsmd_cut,
	.accept = vsmd_accept,
	.begin = vsmd_begin,
	.answer = vsmd_answer,
	.lost = vsmd_lost,
	.gone = vsmd_gone,
	.feedback = vsmd_feedback,
	.nameplate = vsmd_nameplate,
	.broadcast = vsmd_broadcast,
};
