/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/admission.h"

#include "axis/limits.h"
#include "axis/state.h"
#include "drivebridge/command_table.h"
#include "drivebridge/scale.h"

/* --- ids --------------------------------------------------------------------------------------------- */

uint16_t db_admission_id(const struct db_writer *writer, const struct db_command_write *write)
{
	uint16_t id = write->block.command_id;

	return write->has_id || id != writer->last.id ? id : 0;
}

const struct db_used_id *db_admission_find_repeated(const struct db_writer *writer,
                                                    const struct db_command_block *block,
                                                    uint16_t id, bool bare)
{
	const struct db_command_block *executed = &writer->executed;

	if (id != 0 && id == writer->last.id)
		return writer->last.result == DB_RESULT_BUSY ? NULL : &writer->last;
	if (bare && id == 0 && block->command_id != 0 && block->command_id == writer->last.id &&
	    writer->has_executed && executed->command == block->command &&
	    db_command_same_args(block->command, &executed->args, &block->args))
		return &writer->execution;
	return NULL;
}

/* --- what the drive can do ----------------------------------------------------------------------------- */

bool db_admission_is_supported(const struct db_commander *commander, uint16_t command)
{
	return command < DB_CMD_LIMIT && (commander->config.commands & DB_COMMAND_BIT(command));
}

static enum db_result check_command(const struct db_commander *commander,
                                    const struct db_command_block *block)
{
	const struct db_commander_config *config = &commander->config;

	if (!db_command_find(block->command))
		return DB_RESULT_OUT_OF_RANGE;
	if (!db_admission_is_supported(commander, block->command))
		return DB_RESULT_UNSUPPORTED;
	return config->driver->check(config->bus_config, config->drive_config,
	                             (enum db_command)block->command, &block->args);
}

/* What the drive's parameters will be is open. */
static bool settings_are_pending(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->command == DB_CMD_NONE)
			return true;
	}
	return false;
}

unsigned db_commander_input_ports(const struct db_commander *commander)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_nameplate plate;

	if (!driver->input_ports || settings_are_pending(commander))
		return 0;
	db_axis_read_nameplate(commander->config.axis, &plate);
	return plate.doubtful ? 0 : driver->input_ports(&plate);
}

/* --- limits ------------------------------------------------------------------------------------------ */

static struct db_limit_facts collect_limit_facts(const struct db_commander *commander)
{
	const struct db_driver *driver = commander->config.driver;
	const struct db_drive_config *drive = commander->config.drive_config;
	int param = driver->preset_velocity_param;
	struct db_limit_facts facts = { 0 };
	struct db_nameplate plate;
	struct db_snapshot snapshot;

	db_axis_read(commander->config.axis, &snapshot);
	facts.counts = db_scale_counts(drive, &snapshot.feedback);
	facts.scale_open = db_scale_is_open(driver, drive, &snapshot.feedback);
	facts.position = snapshot.feedback.position;
	facts.velocity_counts = db_driver_velocity_counts(driver, drive);
	if (param < 0 || param >= DB_PARAMS_MAX)
		return facts;
	db_axis_read_nameplate(commander->config.axis, &plate);
	facts.has_preset = (plate.valid >> param & 1) && !plate.doubtful &&
	                   !settings_are_pending(commander);
	facts.preset_velocity = (float)db_value_number(driver->params[param].type,
	                                               plate.values[param]);
	return facts;
}

double db_commander_max_velocity(const struct db_commander *commander)
{
	struct db_limit_facts facts = collect_limit_facts(commander);

	return db_limits_max_velocity(commander->config.drive_config, &facts);
}

static enum db_result show_limit(struct db_commander *commander, struct db_writer *writer,
                                 enum db_limit limit)
{
	db_writers_set_limit(&commander->writers, writer, limit);
	return limit == DB_LIMIT_NONE ? DB_RESULT_OK : DB_RESULT_LIMIT;
}

static enum db_result check_limits(struct db_commander *commander, struct db_writer *writer,
                                   const struct db_command_block *block)
{
	struct db_limit_facts facts = collect_limit_facts(commander);

	return show_limit(commander, writer,
	                  db_limits_command(commander->config.drive_config,
	                                    (enum db_command)block->command, &block->args, &facts));
}

/* --- permission -------------------------------------------------------------------------------------- */

bool db_admission_clears_latch(const struct db_commander *commander, enum db_command command)
{
	return commander->watchdog.latched && command == DB_CMD_CLEAR_FAULT;
}

enum db_result db_admission_permit(struct db_commander *commander, struct db_writer *writer,
                                   const struct db_command_block *block, uint16_t id)
{
	enum db_command command = (enum db_command)block->command;
	enum db_result result = check_command(commander, block);

	/* The latch is the bridge's own: it ends also where the drive has nothing to clear. */
	if (result == DB_RESULT_UNSUPPORTED && db_admission_clears_latch(commander, command))
		result = DB_RESULT_OK;
	if (result == DB_RESULT_OK)
		result = check_limits(commander, writer, block);
	if (result != DB_RESULT_OK)
		return result;
	if (db_command_may_move(command) && block->hold_ms != 0 &&
	    !db_hold_may_begin(&commander->hold, &(struct db_hold_terms){ .beat = block->hold_beat,
	                                                                  .counted = true }))
		return DB_RESULT_OUT_OF_RANGE;
	/* The drive is told of one port after the other, and would refuse one in the middle. */
	if (command == DB_CMD_SET_OUTPUTS &&
	    (block->args.output_mask & db_commander_input_ports(commander)) != 0)
		return DB_RESULT_REFUSED;
	if (id != 0 && writer && writer->last.id == 0 && !db_command_is_stop(command))
		return DB_RESULT_RESTARTED;
	if (commander->watchdog.latched && db_command_may_move(command))
		return DB_RESULT_LATCHED;
	return DB_RESULT_OK;
}

enum db_result db_admission_permit_staged(struct db_commander *commander, struct db_writer *writer,
                                          const struct db_command_block *block)
{
	enum db_result result = check_command(commander, block);

	return result == DB_RESULT_OK ? check_limits(commander, writer, block) : result;
}

enum db_result db_admission_permit_settings(struct db_commander *commander,
                                            struct db_writer *writer,
                                            const struct db_setting *settings, size_t count)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_limit_facts facts = collect_limit_facts(commander);

	for (size_t i = 0; i < count; i++) {
		int param = settings[i].param;
		double acceleration;

		if (param != driver->acceleration_param && param != driver->deceleration_param)
			continue;
		acceleration = db_value_number(driver->params[param].type, settings[i].value) *
		               facts.velocity_counts;
		if (show_limit(commander, writer,
		               db_limits_acceleration(commander->config.drive_config, acceleration,
		                                      &facts)) != DB_RESULT_OK)
			return DB_RESULT_LIMIT;
	}
	return DB_RESULT_OK;
}
