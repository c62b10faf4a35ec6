/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on CAN. Drives do not acknowledge: every command goes out in one burst with a read of
 * position and status behind it, and every register write with a read of that register. A CAN
 * controller keeps the order, so the answer to the read comes from behind the command.
 *
 * The read behind a command asks for the registers 1 and 2, the cyclic one for 0 to 2, a probe for
 * one register of the identity: the answers differ in their register or length, so that a late answer
 * or a drive's own report is never taken for a confirmation. Where drives report position and status
 * alone, reports have the form of the first, so the two change places.
 *
 * Source: VSMD CAN 2.0 protocol, sections 1.2, 2, 3 and 4.
 */
#include "codec/vsmd_can.h"
#include "driver/list.h"
#include "driver/vsmd/axis.h"

#include <math.h>
#include <string.h>

/* What a drive usually needs before it answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (500 * DB_NS_PER_US)

/* A register that goes unanswered so often, while what was asked behind it is answered, is one that
 * this model has not. */
#define REGISTER_TRIES 2

/* Registers that are asked for at once. */
#define RUN_MAX 8

/* How many frames a burst can have: seven to begin a shake, and the read. */
#define BURST_MAX 8

/* What is asked behind a read of parameters: another register than a probe's. */
#define GUARD (VSMD_CAN_IDENTITY + 1)

/* Reports are trusted for so many of their intervals. */
#define REPORT_PATIENCE 3

enum option {
	OPTION_FRAMES,
	OPTION_HOST_ID,
	OPTION_OUTPUT_BASE,
	OPTION_REPORT_MS,
	OPTION_REPORT,
	OPTION_OF_DRIVES, /* and those behind it */
};

static const struct db_option options[] = {
	[OPTION_FRAMES] = {
		.section = "bus",
		.name = "frames",
		.words = "extended standard",
		.preset = "extended",
		.unit = "",
		.description = "Kind of CAN frames; standard ones reach the drives 1 to 15 and the "
			       "first 32 registers, and how drives answer in them is not documented",
	},
	[OPTION_HOST_ID] = {
		.section = "bus",
		.name = "host-id",
		.words = "",
		.preset = "1",
		.min = 0,
		.max = VSMD_CAN_SOURCE_MAX,
		.whole = true,
		.unit = "",
		.description = "The bridge's own id in extended frames; drives answer to it",
	},
	[OPTION_OUTPUT_BASE] = {
		.section = "bus",
		.name = "output-base",
		.words = "",
		.preset = "1",
		.min = 0,
		.max = 1,
		.whole = true,
		.unit = "",
		.description = "What drives call their first output port: 1, or 0 on older firmware",
	},
	[OPTION_REPORT_MS] = {
		.section = "bus",
		.name = "report-ms",
		.words = "",
		.preset = "0",
		.min = 0,
		.max = 60000,
		.whole = true,
		.unit = "ms",
		.description = "Lets drives report their status by themselves at this interval "
			       "instead of asking them; 0 asks. Drives whose reports do not come "
			       "are asked",
	},
	[OPTION_REPORT] = {
		.section = "bus",
		.name = "report",
		.words = "all position-status position",
		.preset = "all",
		.unit = "",
		.description = "With report-ms, what drives report. Without the speed, velocity is computed "
			       "from successive positions; without the status, it is still asked for "
			       "every cycle",
	},
	VSMD_DRIVE_OPTIONS,
};

/* In the order of the option's words. */
static const enum vsmd_can_report reports[] = {
	VSMD_CAN_REPORT_ALL,
	VSMD_CAN_REPORT_POSITION_STATUS,
	VSMD_CAN_REPORT_POSITION,
};

struct db_device {
	struct vsmd_axis axis; /* first: the link is given this */
	struct vsmd_can_style style;
	unsigned drive;
	db_time report_interval; /* 0: drives are asked */
	enum vsmd_can_report report;

	struct vsmd_can_answer answer; /* of the exchange under way */
	unsigned answer_to;            /* its number */

	/* Reports: what came in the first frame of one, until the second is there. */
	uint32_t reported[VSMD_CAN_STATUS_REGS];
	bool half_reported;
	db_time reported_at;

	/* Where no speed is read: the position from which one is computed. */
	bool has_base;
	int32_t base;
	db_time base_at;

	/* Registers: which ones this model has not, and what of a guarded read came. */
	uint64_t lacks;
	bool whole; /* the registers that the read behind them guards are there */
};

static struct vsmd_can_style style_of(const struct db_bus_config *bus)
{
	return (struct vsmd_can_style){
		.extended = !(bus->options[OPTION_FRAMES] > 0.0),
		.host = (uint16_t)bus->options[OPTION_HOST_ID],
		.output_base = (uint8_t)bus->options[OPTION_OUTPUT_BASE],
	};
}

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

/* --- bursts ---------------------------------------------------------------------------------- */

static void start_burst(struct db_exchange *exchange, bool repeatable)
{
	exchange->request_length = 0;
	exchange->answer_length = 0;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
}

static bool add_frame(struct db_exchange *exchange, const struct db_can_frame *frame)
{
	if (exchange->request_length + sizeof *frame > exchange->request_size)
		return false;
	memcpy(exchange->request + exchange->request_length, frame, sizeof *frame);
	exchange->request_length += sizeof *frame;
	return true;
}

static bool add_command(const struct vsmd_can_style *style, unsigned drive,
                        const struct vsmd_can_command *command, struct db_exchange *exchange)
{
	struct db_can_frame frame;

	return vsmd_can_encode_command(style, drive, command, &frame) == VSMD_OK &&
	       add_frame(exchange, &frame);
}

static bool lacks(const struct db_device *device, unsigned reg)
{
	return device->lacks >> reg & 1;
}

/* What an answer of so many registers takes, as wire_time() of transports counts it. */
static size_t answer_length(unsigned registers)
{
	size_t frames = (registers + VSMD_CAN_FRAME_REGS - 1) / VSMD_CAN_FRAME_REGS;

	return 8 * frames + 4 * registers;
}

/* The read that ends every burst. */
static enum db_step add_read(const struct db_device *device, enum vsmd_can_code code,
                             unsigned first, unsigned count, struct db_exchange *exchange,
                             enum db_result *result)
{
	struct vsmd_can_command read = {
		.code = code,
		.first = (uint8_t)first,
		.count = (uint8_t)count,
	};

	if (!add_command(&device->style, device->drive, &read, exchange))
		return done(result, DB_RESULT_UNSUPPORTED);
	exchange->answer_length = answer_length(count);
	return DB_STEP_SEND;
}

static enum db_step add_whole_status(const struct db_device *device, struct db_exchange *exchange,
                                     enum db_result *result)
{
	return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, VSMD_CAN_STATUS_REGS,
	                exchange, result);
}

static enum db_step add_position_status(const struct db_device *device,
                                        struct db_exchange *exchange, enum db_result *result)
{
	return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 2, exchange,
	                result);
}

/* Whether what is read in cycles has no speed. */
static bool lacks_speed(const struct db_device *device)
{
	return device->report == VSMD_CAN_REPORT_POSITION_STATUS;
}

static enum db_step read_status(const struct db_device *device, struct db_exchange *exchange,
                                enum db_result *result)
{
	start_burst(exchange, true);
	return lacks_speed(device) ? add_position_status(device, exchange, result) :
	                             add_whole_status(device, exchange, result);
}

static enum db_step add_confirmation(const struct db_device *device, struct db_exchange *exchange,
                                     enum db_result *result)
{
	return lacks_speed(device) ? add_whole_status(device, exchange, result) :
	                             add_position_status(device, exchange, result);
}

/* Models differ in their registers, and a read that touches one that is not there is not answered at
 * all. So one that is there is asked for behind it: when that is answered, nothing more will come. */
static enum db_step add_registers(const struct db_device *device, unsigned first, unsigned count,
                                  struct db_exchange *exchange, enum db_result *result)
{
	if (add_read(device, VSMD_CAN_READ_DATA, first, count, exchange, result) == DB_STEP_DONE ||
	    add_read(device, VSMD_CAN_READ_STATUS, GUARD, 1, exchange, result) == DB_STEP_DONE)
		return DB_STEP_DONE;
	exchange->answer_length = answer_length(count) + answer_length(1);
	return DB_STEP_SEND;
}

static enum db_step read_probe(const struct db_device *device, struct db_exchange *exchange,
                               enum db_result *result)
{
	start_burst(exchange, true);
	return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY, 1, exchange, result);
}

/* --- commands -------------------------------------------------------------------------------- */

/* What a shake is to be comes in frames that nothing confirms: each is said twice, so that one that is
 * lost changes nothing. */
static size_t shake_frames(const struct vsmd_command *command, enum vsmd_can_shake start,
                           struct vsmd_can_command *frames)
{
	size_t count = 0;

	for (unsigned i = 0; i < 2; i++) {
		frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                                     .shake = VSMD_CAN_SHAKE_START_AT,
			                                     .position = command->shake_start };
		frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                                     .shake = VSMD_CAN_SHAKE_END_AT,
			                                     .position = command->shake_end };
		frames[count++] =
			(struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                           .shake = VSMD_CAN_SHAKE_FREQUENCY,
			                           .shake_frequency = command->shake_frequency };
	}
	frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
		                                     .shake = start,
		                                     .shake_count = command->shake_count };
	return count;
}

/* The codes of the commands that one frame carries. */
static enum vsmd_can_code code_of(enum vsmd_verb verb)
{
	switch (verb) {
	case VSMD_ENA:
		return VSMD_CAN_ENA;
	case VSMD_OFF:
		return VSMD_CAN_OFF;
	case VSMD_MOV:
		return VSMD_CAN_MOV;
	case VSMD_POS:
		return VSMD_CAN_POS;
	case VSMD_STP:
		return VSMD_CAN_STP;
	case VSMD_ORG:
		return VSMD_CAN_ORG;
	case VSMD_ECLR:
		return VSMD_CAN_ENCODER;
	case VSMD_SENSOR_OUT:
		return VSMD_CAN_OUTPUT;
	case VSMD_SV:
		return VSMD_CAN_SV;
	case VSMD_NMOS:
		return VSMD_CAN_NMOS;
	case VSMD_ZERO_START:
		return VSMD_CAN_ZERO_START;
	case VSMD_ZERO_STOP:
		return VSMD_CAN_ZERO_STOP;
	case VSMD_SAV:
		return VSMD_CAN_SAV;
	default: /* VSMD_SHAKE_STOP */
		return VSMD_CAN_SHAKE;
	}
}

/* The frames of a command; none for a mere status request. */
static size_t frames_of(const struct vsmd_command *command, struct vsmd_can_command *frames)
{
	switch (command->verb) {
	case VSMD_STS:
		return 0;
	case VSMD_SHAKE_CYCLES:
		return shake_frames(command, VSMD_CAN_SHAKE_CYCLES, frames);
	case VSMD_SHAKE_TIME:
		return shake_frames(command, VSMD_CAN_SHAKE_TIME, frames);
	default:
		frames[0] = (struct vsmd_can_command){
			.code = code_of(command->verb),
			.has_position = command->verb == VSMD_ORG && command->has_value,
			.has_velocity = command->has_velocity,
			.position = command->position,
			.velocity = command->velocity,
			.port = command->port,
			.value = command->value,
			.shake = VSMD_CAN_SHAKE_STOP,
		};
		return 1;
	}
}

static enum db_step link_ask(struct vsmd_axis *axis, const struct vsmd_command *command,
                             bool repeatable, struct db_exchange *exchange, enum db_result *result)
{
	struct db_device *device = (struct db_device *)axis;
	struct vsmd_can_command frames[BURST_MAX - 1];
	size_t count = frames_of(command, frames);

	if (command->verb == VSMD_ORG || command->verb == VSMD_OFF)
		device->has_base = false;
	start_burst(exchange, repeatable);
	for (size_t i = 0; i < count; i++) {
		if (!add_command(&device->style, device->drive, &frames[i], exchange))
			return done(result, DB_RESULT_OUT_OF_RANGE);
	}
	if (command->verb == VSMD_SAV)
		exchange->extra_time = axis->save_time;
	return add_confirmation(device, exchange, result);
}

static enum db_step link_look(struct vsmd_axis *axis, enum vsmd_look look,
                              struct db_exchange *exchange, enum db_result *result)
{
	const struct db_device *device = (const struct db_device *)axis;

	start_burst(exchange, true);
	switch (look) {
	case VSMD_LOOK_SPEED:
		return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 1, exchange,
		                result);
	case VSMD_LOOK_POSITION:
		/* A report of the position alone would look like its answer. */
		if (device->report == VSMD_CAN_REPORT_POSITION)
			return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 2,
			                exchange, result);
		return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 1, exchange,
		                result);
	case VSMD_LOOK_STATUS:
	default:
		return add_confirmation(device, exchange, result);
	}
}

static const struct vsmd_link can_link = {
	.acknowledges = false,
	.shake_frequency_min = VSMD_SHAKE_FREQ_MIN_CAN,
	.first_option = OPTION_OF_DRIVES,
	.ask = link_ask,
	.look = link_look,
};

static enum db_result can_check(const struct db_bus_config *bus,
                                const struct db_drive_config *drive, enum db_command command,
                                const struct db_args *args)
{
	(void)bus;
	(void)drive;
	return vsmd_check(&can_link, command, args);
}

static enum db_result can_check_param(const struct db_bus_config *bus, size_t param,
                                      union db_value value)
{
	if (param >= VSMD_PARAM_COUNT ||
	    !vsmd_can_reg_reachable(vsmd_can_fields[param].reg, style_of(bus).extended))
		return DB_RESULT_UNSUPPORTED;
	return vsmd_can_param_in_range((enum vsmd_param)param, value) ? DB_RESULT_OK :
	                                                                DB_RESULT_OUT_OF_RANGE;
}

/* --- writing parameters ------------------------------------------------------------------------ */

static unsigned reg_of(const struct db_request *request, size_t i)
{
	return vsmd_can_fields[request->settings[i].param].reg;
}

/* The first setting from `i` on whose register was not written for an earlier one. */
static size_t next_setting(const struct db_request *request, size_t i)
{
	for (; i < request->setting_count; i++) {
		size_t j = 0;

		while (j < i && reg_of(request, j) != reg_of(request, i))
			j++;
		if (j == i)
			break;
	}
	return i;
}

/* scratch[0]: the setting whose register is on. scratch[1]: what was written to it. */

/* Puts every setting of this register into its raw value. */
static bool insert_settings(const struct db_request *request, unsigned reg, uint32_t *raw)
{
	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		if (reg_of(request, i) == reg && vsmd_can_insert((enum vsmd_param)setting->param,
		                                                 setting->value, raw) != VSMD_OK)
			return false;
	}
	return true;
}

/* The register with its new content, and the read that shows whether it has it. */
static enum db_step write_register(struct db_device *device, struct db_job *job, uint32_t raw,
                                   struct db_exchange *exchange, enum db_result *result)
{
	unsigned reg = reg_of(job->request, (size_t)job->scratch[0]);
	struct db_can_frame frame;

	if (!insert_settings(job->request, reg, &raw) ||
	    vsmd_can_encode_write(&device->style, device->drive, reg, &raw, 1, &frame) != VSMD_OK)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	job->step = VSMD_SECOND;
	job->scratch[1] = raw;
	start_burst(exchange, true);
	if (!add_frame(exchange, &frame))
		return done(result, DB_RESULT_FAILED);
	return add_registers(device, reg, 1, exchange, result);
}

/* A register that holds several parameters is read first, so that the others stay as they are. */
static enum db_step next_register(struct db_device *device, struct db_job *job, size_t from,
                                  struct db_exchange *exchange, enum db_result *result)
{
	size_t i = next_setting(job->request, from);
	unsigned reg;

	if (i == job->request->setting_count) {
		vsmd_take_settings(&device->axis, job->request);
		return done(result, DB_RESULT_OK);
	}
	job->scratch[0] = (int64_t)i;
	reg = reg_of(job->request, i);
	if (!vsmd_can_reg_packed(reg))
		return write_register(device, job, 0, exchange, result);
	job->step = VSMD_FIRST;
	start_burst(exchange, true);
	return add_registers(device, reg, 1, exchange, result);
}

/* What a register holds, for the parameters in it; their bits. */
static uint64_t take_register(struct db_device *device, unsigned reg, uint32_t raw)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);
	uint64_t taken = 0;

	for (size_t i = 0; i < count; i++) {
		if (vsmd_can_extract(params[i], raw, &device->axis.plate.values[params[i]]) ==
		    VSMD_OK)
			taken |= UINT64_C(1) << params[i];
	}
	return taken;
}

/* A register that is not answered is asked for once more; it may have been a lost frame. */
static enum db_step settings_unanswered(struct db_device *device, struct db_job *job,
                                        struct db_exchange *exchange, enum db_result *result)
{
	unsigned reg = reg_of(job->request, (size_t)job->scratch[0]);

	if (job->step == VSMD_THIRD || job->step == VSMD_READ_BACK) {
		device->axis.plate.doubtful = true;
		return done(result, DB_RESULT_UNSUPPORTED);
	}
	job->step = job->step == VSMD_FIRST ? VSMD_THIRD : VSMD_READ_BACK;
	start_burst(exchange, true);
	return add_registers(device, reg, 1, exchange, result);
}

/* FIRST, THIRD: the register before it is written. SECOND, READ_BACK: behind that. */
static enum db_step answer_settings(struct db_device *device, struct db_job *job,
                                    struct db_exchange *exchange, enum db_result *result)
{
	if (!device->whole)
		return settings_unanswered(device, job, exchange, result);
	if (job->step == VSMD_FIRST || job->step == VSMD_THIRD)
		return write_register(device, job, device->answer.values[0], exchange, result);
	if (device->answer.values[0] != (uint32_t)job->scratch[1]) {
		/* What it holds instead is shown. */
		device->axis.plate.valid |= take_register(device, device->answer.id.reg,
		                                          device->answer.values[0]);
		device->axis.plate.generation++;
		device->axis.plate.doubtful |= job->request->setting_count > 1;
		device->axis.refused = true;
		return done(result, DB_RESULT_REFUSED);
	}
	return next_register(device, job, (size_t)job->scratch[0] + 1, exchange, result);
}

/* --- identity and parameters ------------------------------------------------------------------- */

/*
 * step: FIRST is the identity, then SECOND. scratch[1]: the parameters found, as bits. scratch[0]: the
 * registers asked for (first, and how many), and those among which one is that was not answered (up
 * to which, how many are asked for at once, and how often).
 */
struct search {
	unsigned first;
	unsigned count;
	unsigned suspect_end;
	unsigned run;
	unsigned tries;
};

static struct search unpack_search(const struct db_job *job)
{
	uint64_t packed = (uint64_t)job->scratch[0];

	return (struct search){
		.first = packed & 0xFF,
		.count = packed >> 8 & 0xFF,
		.suspect_end = packed >> 16 & 0xFF,
		.run = packed >> 24 & 0xFF,
		.tries = packed >> 32 & 0xFF,
	};
}

static void pack_search(struct db_job *job, const struct search *search)
{
	job->scratch[0] = (int64_t)(search->first | search->count << 8 | search->suspect_end << 16 |
	                            search->run << 24 | (uint64_t)search->tries << 32);
}

/* Reporting is set anew each time a drive is identified: it may have restarted, or another master
 * have set it otherwise. */
static enum db_step begin_identify(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_can_command report = {
		.code = VSMD_CAN_AUTO_RES_STS,
		.report = device->report,
		.has_interval = device->report_interval > 0,
		.interval = (uint16_t)(device->report_interval / DB_NS_PER_MS),
	};

	job->scratch[1] = 0;
	job->step = VSMD_FIRST;
	start_burst(exchange, true);
	if (!add_command(&device->style, device->drive, &report, exchange))
		return done(result, DB_RESULT_FAILED);
	return add_read(device, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY, VSMD_CAN_IDENTITY_REGS,
	                exchange, result);
}

static void take_identity(struct db_device *device)
{
	uint32_t generation = device->axis.plate.generation;
	char text[VSMD_CAN_IDENTITY_MAX + 1];
	int length = vsmd_can_get_identity(device->answer.values, text);

	if (length > 0)
		vsmd_take_identity(&device->axis, text, (size_t)length);
	/* Another model. */
	if (device->axis.plate.generation != generation)
		device->lacks = 0;
}

static bool is_parameter(const struct db_device *device, unsigned reg)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];

	return vsmd_can_params_of(reg, params) > 0 && !lacks(device, reg) &&
	       vsmd_can_reg_reachable(reg, device->style.extended);
}

/* The next run of registers with parameters, from search->first on. False at the end. */
static bool next_run(const struct db_device *device, struct search *search)
{
	unsigned run;

	while (search->first <= VSMD_CAN_DATA_LAST && !is_parameter(device, search->first))
		search->first++;
	run = search->first < search->suspect_end ? search->run : RUN_MAX;
	search->count = 0;
	while (search->count < run && search->first + search->count <= VSMD_CAN_DATA_LAST &&
	       is_parameter(device, search->first + search->count))
		search->count++;
	return search->count > 0;
}

/* Whether the run is to be asked for again, or less of it. */
static bool narrow(struct db_device *device, struct search *search)
{
	if (search->count > 1) {
		search->suspect_end = search->first + search->count;
		search->run = search->count / 2;
		search->tries = 0;
		return true;
	}
	if (++search->tries < REGISTER_TRIES)
		return true;
	device->lacks |= UINT64_C(1) << search->first;
	search->tries = 0;
	return false;
}

static enum db_step ask_run(struct db_device *device, struct db_job *job, struct search *search,
                            struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_axis *axis = &device->axis;

	if (next_run(device, search)) {
		pack_search(job, search);
		start_burst(exchange, true);
		return add_registers(device, search->first, search->count, exchange, result);
	}
	axis->plate.valid = (uint64_t)job->scratch[1];
	axis->plate.generation++;
	axis->plate.doubtful = false;
	axis->params_valid = true;
	return done(result, DB_RESULT_OK);
}

static enum db_step answer_identify(struct db_device *device, struct db_job *job,
                                    struct db_exchange *exchange, enum db_result *result)
{
	struct search search = { .first = VSMD_CAN_DATA_FIRST };

	if (job->step == VSMD_FIRST) {
		take_identity(device);
		job->step = VSMD_SECOND;
		return ask_run(device, job, &search, exchange, result);
	}
	search = unpack_search(job);
	if (device->whole) {
		for (unsigned i = 0; i < search.count; i++)
			job->scratch[1] |= (int64_t)take_register(device, search.first + i,
			                                          device->answer.values[i]);
		/* What is known is shown at once. */
		device->axis.plate.valid |= (uint64_t)job->scratch[1];
		device->axis.plate.generation++;
		search.first += search.count;
		search.tries = 0;
	} else if (!narrow(device, &search)) {
		search.first += search.count;
	}
	return ask_run(device, job, &search, exchange, result);
}

/* --- jobs -------------------------------------------------------------------------------------- */

static enum db_step can_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	job->step = VSMD_FIRST;
	switch (job->kind) {
	case DB_JOB_PROBE:
		return read_probe(device, exchange, result);
	case DB_JOB_IDENTIFY:
		return begin_identify(device, job, exchange, result);
	case DB_JOB_POLL:
		return read_status(device, exchange, result);
	case DB_JOB_SETTINGS:
		return next_register(device, job, 0, exchange, result);
	case DB_JOB_COMMAND:
	default:
		if (job->request->command == DB_CMD_READ_PARAMETERS) {
			device->lacks = 0;
			return begin_identify(device, job, exchange, result);
		}
		return vsmd_begin_command(&device->axis, job, exchange, result);
	}
}

static enum db_step answer_save(struct vsmd_axis *axis, enum db_result *result)
{
	if (axis->last.status & VSMD_ST_FLASH_ERR)
		return done(result, DB_RESULT_FAILED);
	axis->refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0;
	/* That something was written shows nowhere. */
	return done(result, axis->refused ? DB_RESULT_REFUSED : DB_RESULT_UNPROVEN);
}

/* What a command's read brought. */
static void take_look(struct db_device *device, db_time now)
{
	const struct vsmd_can_answer *answer = &device->answer;
	unsigned first = answer->id.reg;
	unsigned end = first + answer->count;
	const uint32_t *position = &answer->values[VSMD_CAN_STATUS_POSITION - first];
	float speed;

	if (end > VSMD_CAN_STATUS_WORD)
		vsmd_take_confirmation(&device->axis, (int32_t)position[0], position[1], now);
	else if (end > VSMD_CAN_STATUS_POSITION)
		vsmd_take_position(&device->axis, (int32_t)position[0], now);
	/* With the position alone it would be of no use. */
	if (first == VSMD_CAN_STATUS_SPEED && answer->count != 2) {
		memcpy(&speed, &answer->values[0], sizeof speed);
		vsmd_take_speed(&device->axis, speed);
	}
}

static enum db_step answer_command(struct db_device *device, struct db_job *job, db_time now,
                                   struct db_exchange *exchange, enum db_result *result)
{
	if (job->request->command == DB_CMD_READ_PARAMETERS)
		return answer_identify(device, job, exchange, result);
	take_look(device, now);
	if (job->request->command == DB_CMD_SAVE_PARAMETERS)
		return answer_save(&device->axis, result);
	return vsmd_answer_command(&device->axis, job, exchange, result);
}

static void take_process(struct db_device *device, const uint32_t *values, db_time now)
{
	struct vsmd_status status;

	vsmd_can_get_status(values, &status);
	vsmd_take_status(&device->axis, &status, now);
	vsmd_follow_motion(&device->axis);
}

/*
 * The velocity, from this position and the one before. Reports come at even times, whatever the line
 * does to them on their way: `interval` is that of theirs, 0 of a position that was asked for.
 */
static float velocity_to(struct db_device *device, int32_t position, db_time interval, db_time now)
{
	db_time elapsed = now - device->base_at;
	double velocity = 0.0;

	if (interval > 0)
		elapsed = (elapsed + interval / 2) / interval * interval;
	if (elapsed < interval)
		elapsed = interval;
	if (device->has_base && elapsed > 0)
		velocity = ((double)position - (double)device->base) /
		           ((double)elapsed / (double)DB_NS_PER_S);
	/* A position that was set, by a command under way or by hand, is no motion. */
	device->has_base = device->axis.told_until <= now;
	device->base = position;
	device->base_at = now;
	return fabs(velocity) > 2.0 * (double)VSMD_SPEED_MAX ? 0.0f : (float)velocity;
}

/* A position with the status that belongs to it, but no speed. */
static void take_place(struct db_device *device, int32_t position, uint32_t word, db_time interval,
                       db_time now)
{
	struct vsmd_status status = { .position = position, .status = word };
	float velocity = velocity_to(device, position, interval, now);

	/* A status of its own says that it stands. */
	if (device->report == VSMD_CAN_REPORT_POSITION || !(word & VSMD_ST_STP))
		status.velocity = velocity;
	vsmd_take_status(&device->axis, &status, now);
}

static void take_poll(struct db_device *device, db_time now)
{
	const uint32_t *values = device->answer.values;

	if (!lacks_speed(device)) {
		take_process(device, values, now);
		return;
	}
	take_place(device, (int32_t)values[0], values[1], 0, now);
	vsmd_follow_motion(&device->axis);
}

static const struct db_can_frame *frame_at(const struct db_exchange *exchange, size_t from_end,
                                           struct db_can_frame *frame)
{
	size_t offset = from_end * sizeof *frame;

	if (exchange->request_length < offset)
		return NULL;
	memcpy(frame, exchange->request + exchange->request_length - offset, sizeof *frame);
	return frame;
}

/* The read that the exchange waits for: the last one, or what that one guards. */
static bool find_read(const struct db_device *device, const struct db_exchange *exchange,
                      struct vsmd_can_command *read)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	for (size_t from_end = 1; from_end <= 2; from_end++) {
		if (!frame_at(exchange, from_end, &frame) ||
		    vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK)
			return false;
		*read = message.command;
		if (read->code != VSMD_CAN_READ_STATUS || read->first != GUARD)
			return true;
	}
	return false;
}

/* Makes ready for the answer to this exchange: the read at its end says what it must be. */
static bool expect_answer(struct db_device *device, const struct db_exchange *exchange)
{
	struct vsmd_can_command read;

	if (!find_read(device, exchange, &read))
		return false;
	device->answer_to = exchange->sending;
	device->whole = false;
	return vsmd_can_expect(&device->answer, &device->style, device->drive,
	                       read.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
	                                                           VSMD_CAN_DATA_REPLY,
	                       read.first, read.count) == VSMD_OK;
}

/* Whether the answer is all there; MORE and IGNORE as of a driver, DONE: it is. */
static enum db_step collect(struct db_device *device, const struct vsmd_can_message *message)
{
	bool guarded = device->answer.id.control == VSMD_CAN_DATA_REPLY;

	if (guarded && message->id.control == VSMD_CAN_STATUS_REPLY && message->id.reg == GUARD &&
	    message->count == 1)
		return DB_STEP_DONE;
	switch (vsmd_can_take(&device->answer, message)) {
	case VSMD_CAN_PART:
		return DB_STEP_MORE;
	case VSMD_CAN_WHOLE:
		device->whole = true;
		return guarded ? DB_STEP_MORE : DB_STEP_DONE;
	default:
		return DB_STEP_IGNORE;
	}
}

static enum db_step can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;
	struct vsmd_can_message message;
	struct db_can_frame frame;
	enum db_step step;

	if (length != sizeof frame)
		return DB_STEP_IGNORE;
	memcpy(&frame, bytes, sizeof frame);
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK ||
	    (device->answer_to != exchange->sending && !expect_answer(device, exchange)))
		return DB_STEP_IGNORE;
	step = collect(device, &message);
	if (step != DB_STEP_DONE)
		return step;
	switch (job->kind) {
	case DB_JOB_PROBE:
		return done(result, DB_RESULT_OK);
	case DB_JOB_IDENTIFY:
		return answer_identify(device, job, exchange, result);
	case DB_JOB_POLL:
		take_poll(device, now);
		return done(result, DB_RESULT_OK);
	case DB_JOB_SETTINGS:
		return answer_settings(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return answer_command(device, job, now, exchange, result);
	}
}

static enum db_step can_lost(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	return vsmd_lost(&device->axis, job, exchange, result);
}

/* --- reports ------------------------------------------------------------------------------------- */

/* All three registers come in two frames, in this order. */
static bool report_of_all(struct db_device *device, const struct vsmd_can_message *message,
                          db_time now)
{
	if (message->id.reg == VSMD_CAN_STATUS_SPEED && message->count == 2) {
		memcpy(device->reported, message->values, 2 * sizeof message->values[0]);
		device->half_reported = true;
		return true;
	}
	if (message->id.reg != VSMD_CAN_STATUS_WORD || message->count != 1 ||
	    !device->half_reported)
		return false;
	device->half_reported = false;
	device->reported[VSMD_CAN_STATUS_WORD] = message->values[0];
	device->reported_at = now;
	take_process(device, device->reported, now);
	return true;
}

static bool report_of_position_and_status(struct db_device *device,
                                          const struct vsmd_can_message *message, db_time now)
{
	if (message->id.reg != VSMD_CAN_STATUS_POSITION || message->count != 2)
		return false;
	device->reported_at = now;
	take_place(device, (int32_t)message->values[0], message->values[1], device->report_interval,
	           now);
	vsmd_follow_motion(&device->axis);
	return true;
}

/* Its status is the one that was read last; what follows from that waits for the next. */
static bool report_of_position(struct db_device *device, const struct vsmd_can_message *message,
                               db_time now)
{
	if (message->id.reg != VSMD_CAN_STATUS_POSITION || message->count != 1)
		return false;
	if (device->axis.heard)
		take_place(device, (int32_t)message->values[0], device->axis.last.status,
		           device->report_interval, now);
	return true;
}

/* A report comes as the answer to a read of what it holds would. */
static bool can_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	if (length != sizeof frame)
		return false;
	memcpy(&frame, bytes, sizeof frame);
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK ||
	    message.id.control != VSMD_CAN_STATUS_REPLY)
		return false;
	switch (device->report) {
	case VSMD_CAN_REPORT_ALL:
		return report_of_all(device, &message, now);
	case VSMD_CAN_REPORT_POSITION_STATUS:
		return report_of_position_and_status(device, &message, now);
	case VSMD_CAN_REPORT_POSITION:
		return report_of_position(device, &message, now);
	case VSMD_CAN_REPORT_NONE:
	default:
		return false;
	}
}

static bool can_wants_poll(const struct db_device *device, db_time now)
{
	return device->report_interval == 0 || device->reported_at == 0 ||
	       now - device->reported_at > REPORT_PATIENCE * device->report_interval;
}

/* --- state ------------------------------------------------------------------------------------- */

static void can_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	vsmd_axis_feedback(&device->axis, feedback);
}

static void can_gone(struct db_device *device)
{
	vsmd_axis_gone(&device->axis);
	device->half_reported = false;
	device->reported_at = 0;
	device->has_base = false;
}

static const struct db_nameplate *can_nameplate(const struct db_device *device)
{
	return &device->axis.plate;
}

static void can_init(struct db_device *device, struct db_device *first,
                     const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive an address */
	vsmd_axis_init(&device->axis, &can_link, bus, drive);
	device->style = style_of(bus);
	device->drive = drive->address;
	device->report_interval = (db_time)bus->options[OPTION_REPORT_MS] * DB_NS_PER_MS;
	if (device->report_interval > 0)
		device->report = reports[(size_t)bus->options[OPTION_REPORT]];
}

/* --- the bus's side ---------------------------------------------------------------------------- */

static size_t can_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	struct vsmd_can_style style = style_of(bus);

	filters[0] = vsmd_can_answer_filter(&style);
	return 1;
}

static enum db_frame can_accept(const struct db_bus_config *bus, const uint8_t *bytes,
                                size_t length, int *address)
{
	struct vsmd_can_style style = style_of(bus);
	struct vsmd_can_message message;
	struct db_can_frame frame;
	struct vsmd_can_id id;

	if (length != sizeof frame)
		return DB_FRAME_BAD;
	memcpy(&frame, bytes, sizeof frame);
	if (vsmd_can_unpack_id(frame.id, &id) != VSMD_OK || id.extended != style.extended ||
	    (id.control != VSMD_CAN_STATUS_REPLY && id.control != VSMD_CAN_DATA_REPLY) ||
	    (id.extended && id.target != style.host))
		return DB_FRAME_FOREIGN;
	if (vsmd_can_decode(&style, &frame, &message) != VSMD_OK)
		return DB_FRAME_BAD;
	*address = id.source;
	return DB_FRAME_GOOD;
}

static db_time time_of(const struct db_bus_config *bus, const struct vsmd_can_command *command,
                       unsigned registers)
{
	struct vsmd_can_style style = style_of(bus);
	struct db_can_frame frame;

	if (vsmd_can_encode_command(&style, 1, command, &frame) != VSMD_OK)
		return 0;
	return bus->transport->wire_time(bus, (const uint8_t *)&frame, sizeof frame,
	                                 registers > 0 ? answer_length(registers) : 0);
}

/* Drives think side by side, so a poll costs only its time on the wire. */
static db_time can_poll_time(const struct db_bus_config *bus)
{
	const struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS,
		                               .first = 0,
		                               .count = 3 };

	return time_of(bus, &read, VSMD_CAN_STATUS_REGS);
}

static db_time can_command_time(const struct db_bus_config *bus)
{
	const struct vsmd_can_command move = { .code = VSMD_CAN_POS, .has_velocity = true };
	const struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS,
		                               .first = 1,
		                               .count = 2 };

	return time_of(bus, &move, 0) + time_of(bus, &read, 2) + TYPICAL_LATENCY;
}

static bool can_broadcast(enum db_command command, const struct db_bus_config *bus,
                          struct db_exchange *exchange)
{
	const struct db_args none = { 0 };
	struct vsmd_can_style style = style_of(bus);
	struct vsmd_command said = vsmd_command_of(command, &none);
	struct vsmd_can_command frames[BURST_MAX - 1];

	if (!(db_command_is_stop(command) || command == DB_CMD_ENABLE) ||
	    frames_of(&said, frames) != 1)
		return false;
	start_burst(exchange, false);
	return add_command(&style, VSMD_CAN_BROADCAST, &frames[0], exchange);
}

/* The same frame, for everybody, without the read behind it. */
static bool can_begin_all(const struct db_device *device, const struct db_exchange *prepared,
                          struct db_exchange *all)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	if (prepared->request_length != 2 * sizeof frame)
		return false;
	memcpy(&frame, prepared->request, sizeof frame);
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK)
		return false;
	start_burst(all, false);
	return add_command(&device->style, VSMD_CAN_BROADCAST, &message.command, all);
}

static enum db_step can_begun_by_all(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	return vsmd_begun_by_all(&device->axis, exchange, result);
}

static void can_check_config(const struct db_bus_config *bus,
                             const struct db_drive_config *const *drives, size_t drive_count,
                             db_complain_fn *complain, void *context)
{
	if (style_of(bus).extended)
		return;
	for (size_t i = 0; i < drive_count; i++) {
		if (drives[i]->address > VSMD_CAN_STD_DRIVE_MAX)
			complain(
				context, drives[i], true,
				"address = %u cannot be said in standard frames; one from 1 to %d, "
				"or frames = extended on bus '%s'",
				drives[i]->address, VSMD_CAN_STD_DRIVE_MAX, bus->name);
	}
}

const struct db_driver db_driver_vsmd_can = {
	.name = "vsmd-can",
	.title = "VSMD stepper on CAN",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = VSMD_CAN_DRIVE_MAX,
	.default_baud = 100000,
	.options = options,
	.option_count = sizeof options / sizeof options[0],
	.commands = VSMD_COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS,
	.output_count = 6,
	.params = vsmd_can_params,
	.param_count = VSMD_PARAM_COUNT,
	.status_bits = vsmd_status_bits,
	.status_bit_count = VSMD_STATUS_BITS,
	.param_page = 0,
	.acceleration_param = VSMD_ACC,
	.deceleration_param = VSMD_DEC,
	.preset_velocity_param = VSMD_SPD,
	.check = can_check,
	.check_param = can_check_param,
	.input_ports = vsmd_input_ports,
	.check_config = can_check_config,
	.poll_time = can_poll_time,
	.command_time = can_command_time,
	.device_size = sizeof(struct db_device),
	.init = can_init,
	.filters = can_filters,
	.cut = db_can_cut,
	.accept = can_accept,
	.begin = can_begin,
	.answer = can_answer,
	.lost = can_lost,
	.report = can_report,
	.wants_poll = can_wants_poll,
	.gone = can_gone,
	.feedback = can_feedback,
	.nameplate = can_nameplate,
	.broadcast = can_broadcast,
	.begin_all = can_begin_all,
	.begun_by_all = can_begun_by_all,
};
