/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The serial port of a line where a PLC is the master, with a thread of its own: opening and
 * closing a port can last, and the silences of Modbus RTU are short. The thread opens the port,
 * again and again when it is lost, cuts what it receives into frames, and hands those to the
 * network thread that may be requests for this gateway; what other devices of the line are asked
 * and answer stays there. The functions are for the network thread, and never wait.
 */
#ifndef DRIVEBRIDGE_SERVER_RTU_PORT_H
#define DRIVEBRIDGE_SERVER_RTU_PORT_H

#include "drivebridge/config.h"
#include "drivebridge/time.h"
#include "server/rtu_frames.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_rtu_port;

/* A frame with a right CRC, for a unit of this line or for all (unit 0). */
struct db_rtu_frame {
	uint32_t number; /* for its answer; 0: it is a broadcast, or a later one has replaced it */
	db_time at;      /* arrival of its last byte */
	uint16_t length; /* CRC included */
	uint8_t bytes[DB_RTU_FRAME_MAX];
};

/* Counters since the line began; they go on from 0 when they are full. */
struct db_rtu_figures {
	bool up;           /* the port is open */
	int error;         /* why not, as an errno */
	uint32_t openings; /* each is another client: what an earlier one was owed is void */
	uint32_t frames;   /* with a right CRC, without echoes */
	uint32_t foreign;  /* of these for, or from, other devices */
	uint32_t bad;      /* silences that ended bytes which are no frames */
	uint32_t overruns; /* more bytes than frames have, without a silence */
	uint32_t answers;  /* sent */
	uint32_t sent;     /* number of the frame that was answered last; 0: none */
	uint32_t late;     /* not sent: the PLC did not wait any longer */
	uint32_t missed;   /* requests after which another one came before they were taken */
	uint32_t echoes;   /* received of what was sent */
};

/* The thread waits for db_rtu_port_begin(). The settings are copied, with their texts. 0 or a
 * negative errno. */
int db_rtu_port_new(const struct db_rtu_config *config, struct db_rtu_port **port);
void db_rtu_port_begin(struct db_rtu_port *port);

/* Readable when there is a frame, or the port was opened or lost. */
int db_rtu_port_fd(const struct db_rtu_port *port);
void db_rtu_port_read(struct db_rtu_port *port, struct db_rtu_figures *figures);
/* The next frame; false: there is none. */
bool db_rtu_port_take(struct db_rtu_port *port, struct db_rtu_frame *frame);

/* Sends the answer to the frame of this number, with its CRC; unless something was received since,
 * or it is too late for the PLC. */
void db_rtu_port_answer(struct db_rtu_port *port, uint32_t number, const uint8_t *bytes,
                        size_t length);

/* The thread ends and frees the port, which is not used afterwards. Null is fine. Does not wait:
 * it may be opening the port. */
void db_rtu_port_end(struct db_rtu_port *port);

#endif
