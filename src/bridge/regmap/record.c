/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "drivebridge/audit.h"

uint32_t db_record_request(void *context, const struct db_recorded *recorded)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;
	const struct db_request *request = recorded->request;
	struct db_audit_value values[DB_SETTINGS_MAX];
	struct db_audit_entry entry = {
		.kind = request->command == DB_CMD_NONE ? DB_AUDIT_WRITE : DB_AUDIT_COMMAND,
		.result = recorded->result,
		.of = recorded->joined,
		.drive = drive->config->name,
		.bus = drive->bus_config->name,
		.node = (uint16_t)drive->config->address,
		.axis = (uint16_t)drive->config->axis,
		.command = (uint16_t)request->command,
		.id = request->id,
		.first = recorded->address,
	};
	const struct db_driver *driver = drive->driver;
	struct db_nameplate_copy copy;

	if (!registers->ops->audit)
		return 0;
	if (request->command != DB_CMD_NONE && request->args)
		entry.args = *request->args;
	if (request->setting_count > 0) {
		/* Values before as far as the drive has told them. */
		db_axis_read_nameplate(drive->axis, &copy);
		for (size_t i = 0; i < request->setting_count; i++) {
			unsigned param = request->settings[i].param;

			if (param >= driver->param_count)
				continue;
			values[entry.value_count++] = (struct db_audit_value){
				.name = driver->params[param].name,
				.type = driver->params[param].type,
				.old = copy.plate.values[param],
				.new = request->settings[i].value,
				.known = db_params_have(copy.plate.valid, param),
				.secret = driver->params[param].traits &DB_PARAM_SECRET,
			};
		}
		entry.values = values;
	}
	if (!db_request_client(request) && request->cause != DB_STAND_FREE)
		entry.text = db_stand_cause_name(request->cause);
	return registers->ops->audit(registers->context, db_request_client(request), &entry);
}

void db_record_end(void *context, uint32_t record, enum db_result result, db_time took)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (registers->ops->audit_end)
		registers->ops->audit_end(registers->context, record, drive->config->name, result,
		                          took);
}

void db_record_control(const struct db_view_drive *drive, const struct db_client *client,
                       bool taken)
{
	const struct db_registers *registers = drive->registers;

	if (registers->ops->audit)
		(void)registers->ops->audit(registers->context, client,
		                            &(struct db_audit_entry){
						    .kind = DB_AUDIT_CONTROL,
						    .drive = drive->config->name,
						    .what = taken ? "taken" : "released",
						    .result = DB_RESULT_OK,
					    });
}

void db_record_watchdog(const struct db_view_drive *drive, const struct db_client *client,
                        uint32_t old, uint32_t new)
{
	const struct db_registers *registers = drive->registers;
	const struct db_audit_value value = {
		.name = "watchdog_ms",
		.type = DB_U32,
		.old.u = old,
		.new.u = new,
		.known = true,
	};

	if (registers->ops->audit)
		(void)registers->ops->audit(registers->context, client,
		                            &(struct db_audit_entry){
						    .kind = DB_AUDIT_WRITE,
						    .drive = drive->config->name,
						    .values = &value,
						    .value_count = 1,
						    .result = DB_RESULT_OK,
					    });
}

void db_record_denied(const struct db_registers *registers, const struct db_view_drive *drive,
                      const struct db_client *client, uint8_t unit, uint16_t address,
                      const char *why)
{
	if (registers->ops->audit)
		(void)registers->ops->audit(registers->context, client,
		                            &(struct db_audit_entry){
						    .kind = DB_AUDIT_DENIED,
						    .drive = drive ? drive->config->name : NULL,
						    .unit = unit,
						    .what = "write",
						    .first = address,
						    .text = why,
					    });
}
