/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters and the profile of the configuration. No frame reads them back: what was written and
 * acknowledged is shown, and the write's result is UNPROVEN. */
#include "driver/servo_can/servo_can_private.h"

#include "driver/servo_can/frames.h"
#include "driver/servo_can/options.h"

#include <math.h>
#include <string.h>

#define LEVEL_OF(bit, text)                                                                \
	{                                                                                  \
		.name = (bit), .type = DB_U16, .unit = "", .max = 1, .description = (text) \
	}

/* The drive's ramps are whole numbers; they are floats here because the neutral registers are. */
const struct db_param servo_can_params[SERVO_CAN_PARAM_COUNT] = {
	[PARAM_ACCELERATION] = {
		.name = "ramp_acceleration",
		.type = DB_F32,
		.unit = "rpm/s",
		.max = UINT32_MAX,
		.description = "Acceleration; write only in the drive and readable once written, "
			       "also by the configuration's ramp-acceleration; written together "
			       "with ramp_deceleration the first time",
		.traits = DB_PARAM_TOGETHER,
	},
	[PARAM_DECELERATION] = {
		.name = "ramp_deceleration",
		.type = DB_F32,
		.unit = "rpm/s",
		.max = UINT32_MAX,
		.description = "Deceleration; as ramp_acceleration",
		.traits = DB_PARAM_TOGETHER,
	},
	[PARAM_MAX_SPEED] = {
		.name = "max_speed",
		.type = DB_U16,
		.unit = "rpm",
		.max = UINT16_MAX,
		.description = "Speed limit; write only in the drive and readable once written, "
			       "also by the configuration's max-speed; goes with the mode, so "
			       "while the motor stands; speed mode if the bridge knows none",
	},
	[PARAM_CCLR] = LEVEL_OF("cclr", "Bit 1 of command word 0: clear the position error; what "
	                                "it does depends on the drive's address 0x10A7; held until "
	                                "written again; needs the command-word keys"),
	[PARAM_ZCLAMP] = LEVEL_OF("zclamp", "Bit 2 of command word 0: zero speed clamp; as cclr"),
	[PARAM_TRQLM] = LEVEL_OF("trqlm", "Bit 4 of command word 0: torque limit; as cclr"),
	[PARAM_SPDLM] = LEVEL_OF("spdlm", "Bit 5 of command word 0: speed limit; as cclr"),
	[PARAM_POS0] = LEVEL_OF("pos0", "Bit 6 of command word 0: which internal position; as "
	                                "cclr; move_absolute and move_relative need position 0"),
	[PARAM_POS1] = LEVEL_OF("pos1", "Bit 7 of command word 0: as pos0"),
	[PARAM_POS2] = LEVEL_OF("pos2", "Bit 8 of command word 0: as pos0"),
	[PARAM_WORD_1] = {
		.name = "command_word_1",
		.type = DB_U16,
		.unit = "",
		.max = UINT16_MAX,
		.description = "Command word 1, whose bits only the vendor's full manual "
			       "explains; held until written again; needs command-word-1-at",
	},
};

static const uint16_t word_bits[] = {
	SERVO_CAN_CCLR, SERVO_CAN_ZCLAMP, SERVO_CAN_TRQLM, SERVO_CAN_SPDLM,
	SERVO_CAN_POS0, SERVO_CAN_POS1,   SERVO_CAN_POS2,
};

enum db_result servo_can_check_param(const struct db_bus_config *bus, size_t param,
                                     union db_value value)
{
	struct servo_can_layout layout;
	double number;

	if (param >= SERVO_CAN_PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
	if (param >= PARAM_CCLR) {
		layout = servo_can_read_layout(bus);
		if (!layout.words.set || (param == PARAM_WORD_1 && !layout.word1.set &&
		                          layout.words.word1 == SERVO_CAN_NO_WORD))
			return DB_RESULT_UNSUPPORTED;
	}
	number = db_value_number(servo_can_params[param].type, value);
	return number >= servo_can_params[param].min && number <= servo_can_params[param].max ?
	               DB_RESULT_OK :
	               DB_RESULT_OUT_OF_RANGE;
}

/* --- what is known ---------------------------------------------------------------------------- */

void servo_can_remember(struct db_device *device, enum servo_can_param param, double value,
                        db_time now)
{
	if (servo_can_params[param].type == DB_F32)
		device->plate.values[param].f = (float)value;
	else
		device->plate.values[param].u = (uint32_t)value;
	device->plate.valid[0] |= PARAM_BIT(param);
	db_nameplate_note_told(&device->plate, &(uint64_t){ PARAM_BIT(param) }, now);
	device->plate.generation++;
}

void servo_can_remember_words(struct db_device *device, db_time now)
{
	for (size_t i = 0; i < sizeof(word_bits) / sizeof(word_bits[0]); i++)
		servo_can_remember(device, (enum servo_can_param)(PARAM_CCLR + i),
		                   (device->words[0] & word_bits[i]) != 0, now);
	if (device->layout.words.word1 != SERVO_CAN_NO_WORD)
		servo_can_remember(device, PARAM_WORD_1, device->words[1], now);
}

static uint64_t settings_wanted(const struct db_request *request)
{
	uint64_t wanted = 0;

	for (size_t i = 0; i < request->setting_count; i++)
		wanted |= PARAM_BIT(request->settings[i].param);
	return wanted;
}

void servo_can_forget_settings(struct db_device *device, const struct db_request *request)
{
	uint64_t wanted = settings_wanted(request);

	/* Parameters that share a frame are all known or all unknown. */
	if (wanted & RAMPS)
		wanted |= RAMPS;
	if (wanted & WORDS)
		wanted |= WORDS;
	device->plate.valid[0] &= ~wanted;
	device->plate.generation++;
}

/* --- a parameter write ------------------------------------------------------------------------ */

/* The last value for it in the request, else the one written before. */
static double value_for(struct db_conversation *talk, enum servo_can_param param)
{
	const struct db_request *request = talk->job->request;
	union db_value value = talk->device->plate.values[param];

	for (size_t i = 0; i < request->setting_count; i++) {
		if (request->settings[i].param == param)
			value = request->settings[i].value;
	}
	return db_value_number(servo_can_params[param].type, value);
}

static enum db_step send_words(struct db_conversation *talk)
{
	uint64_t wanted = settings_wanted(talk->job->request);
	uint16_t words[2] = { talk->device->words[0], talk->device->words[1] };

	for (size_t i = 0; i < sizeof(word_bits) / sizeof(word_bits[0]); i++) {
		enum servo_can_param param = (enum servo_can_param)(PARAM_CCLR + i);

		if (!(wanted & PARAM_BIT(param)))
			continue;
		words[0] = (uint16_t)(words[0] & ~word_bits[i]);
		if (value_for(talk, param) != 0.0)
			words[0] |= word_bits[i];
	}
	if ((wanted & PARAM_BIT(PARAM_WORD_1)) && !talk->device->layout.word1.set)
		words[1] = (uint16_t)value_for(talk, PARAM_WORD_1);
	return servo_can_send_words(talk, words);
}

/* The frame of the maximum speed contains a mode, too: the drive's present mode. An unknown mode
 * may only be changed without power. */
static enum db_result choose_mode(const struct db_device *device, enum servo_can_mode *mode)
{
	int known = device->mode != SERVO_CAN_MODE_NOT_KNOWN ? device->mode : device->profile.mode;

	*mode = known != SERVO_CAN_MODE_NOT_KNOWN ? (enum servo_can_mode)known :
	                                            SERVO_CAN_MODE_SPEED;
	if (!device->may_change_mode)
		return DB_RESULT_UNSUPPORTED;
	if (device->mode == SERVO_CAN_MODE_NOT_KNOWN && servo_can_is_powered(device))
		return DB_RESULT_REFUSED;
	return servo_can_is_at_rest(device) ? DB_RESULT_OK : DB_RESULT_BUSY;
}

/* Nothing is sent unless all of it can be sent. */
static enum db_result check_settings(struct db_conversation *talk, uint64_t wanted)
{
	enum servo_can_mode mode;

	/* One frame contains both, and the other value is not known if it was never written. */
	if ((wanted & RAMPS) && (RAMPS & ~(wanted | talk->device->plate.valid[0])) != 0)
		return DB_RESULT_OUT_OF_RANGE;
	return wanted & PARAM_BIT(PARAM_MAX_SPEED) ? choose_mode(talk->device, &mode) :
	                                             DB_RESULT_OK;
}

enum db_step servo_can_continue_settings(struct db_conversation *talk)
{
	uint64_t wanted = settings_wanted(talk->job->request);
	/* The parameters in the frame of command word 0. */
	uint64_t shared = talk->device->layout.word1.set ? WORDS & ~PARAM_BIT(PARAM_WORD_1) : WORDS;
	enum db_result checked;

	if ((wanted & PARAM_BIT(PARAM_MAX_SPEED)) && !is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	if (!progress_of(talk)->checked) {
		checked = check_settings(talk, wanted);
		if (checked != DB_RESULT_OK)
			return end_job(talk, checked);
		progress_of(talk)->checked = true;
	}
	if ((wanted & RAMPS) && !is_done(talk, STEP_RAMPS))
		return servo_can_send_ramps(talk,
		                            (uint32_t)llrint(value_for(talk, PARAM_ACCELERATION)),
		                            (uint32_t)llrint(value_for(talk, PARAM_DECELERATION)));
	if ((wanted & shared) && !is_done(talk, STEP_WORDS))
		return send_words(talk);
	if ((wanted & WORDS & ~shared) && !is_done(talk, STEP_WORD_1))
		return servo_can_send_word_1(talk, (uint16_t)value_for(talk, PARAM_WORD_1));
	if ((wanted & PARAM_BIT(PARAM_MAX_SPEED)) && !is_done(talk, STEP_MODE)) {
		uint16_t max_speed = (uint16_t)value_for(talk, PARAM_MAX_SPEED);
		enum servo_can_mode mode;
		enum db_result result = choose_mode(talk->device, &mode);

		/* Also when a stop was sent in between. */
		if (result != DB_RESULT_OK)
			return end_job(talk, result);
		return servo_can_send_mode(talk, mode, &max_speed);
	}
	return end_job(talk, DB_RESULT_UNPROVEN);
}

/* --- the profile ------------------------------------------------------------------------------ */

/* Sends all words that are held, in one frame or two. */
static bool sends_words(struct db_conversation *talk, enum db_step *step)
{
	const struct db_device *device = talk->device;

	if (!is_done(talk, STEP_WORDS))
		*step = servo_can_send_words(talk, device->words);
	else if (device->layout.word1.set && !is_done(talk, STEP_WORD_1))
		*step = servo_can_send_word_1(talk, device->words[1]);
	else
		return false;
	return true;
}

static bool lacks_mode(const struct db_device *device)
{
	bool mode = device->profile.mode != SERVO_CAN_MODE_NOT_KNOWN &&
	            device->mode == SERVO_CAN_MODE_NOT_KNOWN;

	return device->may_change_mode && (servo_can_lacks_max_speed(device) || mode);
}

bool servo_can_sends_all(struct db_conversation *talk, enum db_step *step)
{
	const struct db_device *device = talk->device;
	const struct db_nameplate *plate = &device->plate;
	bool ramps_known = (plate->valid[0] & RAMPS) == RAMPS;
	uint16_t max_speed;
	bool known;
	int mode;

	if (!is_done(talk, STEP_RAMPS) && (ramps_known || !isnan(device->profile.acceleration))) {
		*step = ramps_known ?
		                servo_can_send_ramps(
					talk, (uint32_t)plate->values[PARAM_ACCELERATION].f,
					(uint32_t)plate->values[PARAM_DECELERATION].f) :
		                servo_can_send_ramps(talk, (uint32_t)device->profile.acceleration,
		                                     (uint32_t)device->profile.deceleration);
		return true;
	}
	if (device->words_given && sends_words(talk, step))
		return true;
	/* The profile's mode, else the one that the drive is assumed to have. */
	max_speed = (uint16_t)plate->values[PARAM_MAX_SPEED].u;
	known = (plate->valid[0] & PARAM_BIT(PARAM_MAX_SPEED)) != 0;
	mode = device->profile.mode != SERVO_CAN_MODE_NOT_KNOWN ? device->profile.mode :
	                                                          device->mode;
	if (mode == SERVO_CAN_MODE_NOT_KNOWN && servo_can_lacks_max_speed(device))
		mode = SERVO_CAN_MODE_SPEED;
	if (!device->may_change_mode || mode == SERVO_CAN_MODE_NOT_KNOWN ||
	    (is_done(talk, STEP_MODE) && device->mode == mode))
		return false;
	*step = servo_can_send_mode(talk, (enum servo_can_mode)mode, known ? &max_speed : NULL);
	return true;
}

enum db_step servo_can_continue_identify(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	uint64_t missing = ~device->plate.valid[0];
	uint64_t word_1 = device->layout.word1.set ? PARAM_BIT(PARAM_WORD_1) : 0;
	bool lacks_ramps = !isnan(device->profile.acceleration) && (RAMPS & missing) != 0;
	/* Words that the PLC has set are kept and sent again, also when the drive has forgotten
	 * them. */
	bool lacks_words = device->words_given && ((PARAM_BIT(PARAM_CCLR) | word_1) & missing) != 0;
	enum servo_can_mode mode;
	enum db_step step;

	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	/* No identity and no parameter can be read. */
	device->params_valid = true;
	/* Those values of the profile that the drive does not have and may be given now. A motor
	 * with power keeps its mode: the next command that changes the mode also sends the speed
	 * limit. */
	if (servo_can_is_at_rest(device)) {
		if (lacks_ramps && !is_done(talk, STEP_RAMPS))
			return servo_can_send_ramps(talk, (uint32_t)device->profile.acceleration,
			                            (uint32_t)device->profile.deceleration);
		if (lacks_words && sends_words(talk, &step))
			return step;
		if (lacks_mode(device) && !is_done(talk, STEP_MODE) &&
		    choose_mode(device, &mode) == DB_RESULT_OK)
			return servo_can_send_mode(talk, mode, NULL);
	}
	/* What is still missing is sent again later. */
	device->plate.doubtful = lacks_ramps || lacks_words || lacks_mode(device);
	return end_job(talk, DB_RESULT_OK);
}
