<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<!--
Glossary (English: Chinese). Keep to it; docs/development.md tells how texts get here. The robot is stopped (停止) by this program,
never by an emergency stop (急停), which is the power cut (断电开关).

robot, head, tail: 机器人, 头端, 尾端        vessel, lumen, wall: 血管, 管腔, 管壁      centerline, skeleton: 中心线, 骨架
phantom: 体模                                rig, bench: 装置, 台架                      bench twin: 数字孪生台架
pose, pose state: 位姿, 位姿状态             theta: θ (夹角)                             confidence: 置信度
on the centerline: 在中心线上                coming back, moving away: 正在返回, 正在偏离   crossed: 已越过
advice: 建议                                 command: 指令                               gate: 安全闸
mode: 模式                                   advisory, autonomous: 建议模式, 自主模式    armed, arm, disarm: 待命, 进入待命, 解除待命
hold, stopped: 保持, 已停止                  hand over, take back: 移交控制, 收回控制    deadman: 使能键
acknowledge: 确认                            fault, alert: 故障, 警报                    refusal: 无位姿, with its reason
servo, servo bus: 舵机, 舵机总线             tendon, wire: 驱动丝                        catheter, sheath, delivery: 鞘管
bend, pitch, roll: 弯曲, 俯仰, 滚转          insertion: 进深                             envelope: 行程范围
zero, pretension, slack: 归零, 预紧, 松弛    torque: 力矩                                watchdog: 看门狗
session, recording: 会话, 录制               playback, player: 回放, 回放器              snapshot, clip: 截图, 片段
annotation, rater: 标注, 标注者              mask: 掩膜                                  calibration: 标定
target: 目标点                               route: 路线                                 overlay: 叠加层
-->
<TS version="2.1" language="zh_CN" sourcelanguage="en">
<context>
    <name>LumenPilot</name>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>end the line, take the state, go on</source>
        <translation>结束线，采用状态，继续</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>select the next point</source>
        <translation>选择下一个点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>move it by 1 px; Ctrl 0.1, Shift 10</source>
        <translation>移动 1 px；Ctrl 为 0.1，Shift 为 10</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>no point selected: set one at the cross</source>
        <translation>未选点时：在十字处放一个</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>take the point out</source>
        <translation>删除该点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>the whole line</source>
        <translation>整条线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>Space+drag</source>
        <translation>Space+拖动</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>move the picture</source>
        <translation>移动图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>let go of the line or the point; a click goes on</source>
        <translation>放开线或点；单击继续</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>algorithm: θ {theta:.1f}°</source>
        <translation>算法：θ {theta:.1f}°</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>Picture to annotate</source>
        <translation>待标注的图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/canvas.py"/>
        <source>Click sets points; arrow keys move the selected point or the cross, Insert sets a point</source>
        <translation>单击放置点；方向键移动所选的点或十字，Insert 放置点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Enter or double click ends it · drag a point, click the line to put one in, right click takes one out</source>
        <translation>Enter 或双击结束 · 拖动点，单击线插入点，右击删除点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>then drag a point, click the outline to put one in · S fewer points · G the algorithm's mask of this tool</source>
        <translation>然后拖动点，单击轮廓可加入一点 · S 减少点数 · G 取此工具的算法掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>short: {robot:.0f} + {vessel:.0f} px</source>
        <translation>偏短：{robot:.0f} + {vessel:.0f} px</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Robot line</source>
        <translation>机器人线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Click along the robot from its tail to its HEAD</source>
        <translation>沿机器人从尾端到头端依次单击</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Vessel line</source>
        <translation>血管线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Click along the vessel's centerline beside the head</source>
        <translation>在头端旁沿血管中心线依次单击</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Robot mask</source>
        <translation>机器人掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Click around the robot, Enter closes the outline</source>
        <translation>沿机器人四周单击，回车闭合轮廓</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Vessel mask</source>
        <translation>血管掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Click around the vessel, Enter closes the outline</source>
        <translation>沿血管四周单击，回车闭合轮廓</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Region</source>
        <translation>区域</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Add or take away what lies around a click, up to its edges</source>
        <translation>添加或去除单击处周围直到边缘的部分</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Click adds the region around it, Shift + click or right click takes it away · wheel or [ ] size, Ctrl + wheel zoom · R back to points</source>
        <translation>单击添加周围区域，Shift + 单击或右键单击去除 · 滚轮或 [ ] 调大小，Ctrl + 滚轮缩放 · R 返回点编辑</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Brush</source>
        <translation>画笔</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Paint the mask instead of moving its points</source>
        <translation>涂抹掩膜，而不是移动其点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Drag paints, Shift + drag or right drag takes away · wheel or [ ] size, Ctrl + wheel zoom · Insert and Delete paint at the cross · S fewer points · T back to points</source>
        <translation>拖动为涂画，Shift + 拖动或右键拖动为擦除 · 滚轮或 [ ] 改大小，Ctrl + 滚轮缩放 · Insert 和 Delete 在十字处涂擦 · S 减少点数 · T 返回点编辑</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Tube</source>
        <translation>管</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Drag along the middle of a vessel: both walls are found</source>
        <translation>沿血管中线拖动：自动找到两侧管壁</translation>
    </message>
    <message>
        <location filename="../../app/annotator/editing.py"/>
        <source>Drag along the middle, the circle as wide as the vessel: both walls are found · wheel or [ ] width, also in the drag, Ctrl + wheel zoom · right drag takes away · Y back to points</source>
        <translation>沿中线拖动，圆与血管同宽：自动找到两侧管壁 · 滚轮或 [ ] 调宽度，拖动中也可，Ctrl + 滚轮缩放 · 右键拖动去除 · Y 返回点编辑</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Training set (a folder)</source>
        <translation>训练集（文件夹）</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Table for evaluate (*.csv)</source>
        <translation>供 evaluate 使用的表格 (*.csv)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Angles over time, with a figure (*.csv)</source>
        <translation>随时间变化的角度，附图 (*.csv)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>A folder of pictures, or a session</source>
        <translation>图像文件夹，或会话</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Files of other programs</source>
        <translation>其他程序的文件</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Export as</source>
        <translation>导出为</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Exporting {name}</source>
        <translation>正在导出 {name}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Comparing the raters</source>
        <translation>正在比较评估者</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>The algorithm perceives the images</source>
        <translation>算法正在识别图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Written: {path}</source>
        <translation>已写入：{path}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>{count} images got annotations</source>
        <translation>{count} 幅图像获得了标注</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source> (and {count} more)</source>
        <translation>（以及另外 {count} 个）</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Wait until the other one is done</source>
        <translation>请等另一项完成</translation>
    </message>
    <message>
        <location filename="../../app/annotator/files.py"/>
        <source>Nothing was imported</source>
        <translation>没有导入任何内容</translation>
    </message>
    <message>
        <location filename="../../app/annotator/outline_editor.py"/>
        <source>Undone: {action}</source>
        <translation>已撤销：{action}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/outline_editor.py"/>
        <source>Nothing to undo</source>
        <translation>没有可撤销的</translation>
    </message>
    <message>
        <location filename="../../app/annotator/outline_editor.py"/>
        <source>Done again: {action}</source>
        <translation>已重做：{action}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/outline_editor.py"/>
        <source>Nothing to redo</source>
        <translation>没有可重做的</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>short</source>
        <translation>偏短</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>new</source>
        <translation>未开始</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>begun</source>
        <translation>已开始</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>done</source>
        <translation>已完成</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>can't tell</source>
        <translation>无法判断</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>no robot</source>
        <translation>没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>algorithm</source>
        <translation>算法</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>followed</source>
        <translation>跟踪</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>corrected</source>
        <translation>已修正</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>All images</source>
        <translation>所有图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Without an answer</source>
        <translation>没有答案</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Answered</source>
        <translation>已回答</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>With masks</source>
        <translation>有掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>With a note</source>
        <translation>有备注</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>With short lines</source>
        <translation>有偏短的线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Not drawn by hand</source>
        <translation>并非手工绘制</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Loupe</source>
        <translation>放大镜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>The surroundings of the cursor, magnified</source>
        <translation>光标周围的放大图</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Masks</source>
        <translation>掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Show the drawn masks</source>
        <translation>显示已画的掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Algorithm</source>
        <translation>算法</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Show what the algorithm says: answers after it are told apart. Not in a blind study</source>
        <translation>显示算法的结果：此后给出的答案会单独注明。盲法研究中不显示</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Can't tell</source>
        <translation>无法判断</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>A robot may be there, but the picture does not show its pose</source>
        <translation>可能有机器人，但图像看不出其位姿</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>No robot</source>
        <translation>没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>The picture shows no robot</source>
        <translation>图像中没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>{finished} of {count} done</source>
        <translation>{count} 张中完成 {finished} 张</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>The lines say the same</source>
        <translation>两条线的结论相同</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>{meaning}  (key {key})</source>
        <translation>{meaning}  （按键 {key}）</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>State of the file</source>
        <translation>文件的状态</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>⚠  NOT SAVED: 1 edit</source>
        <translation>⚠  未保存：1 处编辑</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>⚠  NOT SAVED: {count} edits</source>
        <translation>⚠  未保存：{count} 处编辑</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Images</source>
        <translation>图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Which images are listed</source>
        <translation>列出哪些图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Progress</source>
        <translation>进度</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Readout</source>
        <translation>读数</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>No state yet</source>
        <translation>还没有状态</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>No state</source>
        <translation>没有状态</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>{key} takes it back</source>
        <translation>{key} 可撤回</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>Blind: press A B C D; then theta is shown</source>
        <translation>盲法：按 A B C D；之后才显示 θ</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>The lines say {state}: Enter takes it, or press A B C D</source>
        <translation>两条线表明 {state}：按 Enter 采用，或按 A B C D</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>The lines say {state}, by the rule</source>
        <translation>按规则，两条线表明 {state}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>✓  saved</source>
        <translation>✓  已保存</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>saving</source>
        <translation>正在保存</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>, with masks</source>
        <translation>，有掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>hidden</source>
        <translation>已隐藏</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>crossed</source>
        <translation>越过</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>lines used</source>
        <translation>所用线长</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>, {left} left</source>
        <translation>，剩余 {left}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>theta</source>
        <translation>θ</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>moving</source>
        <translation>移动中</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>short lines</source>
        <translation>偏短的线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>yes</source>
        <translation>是</translation>
    </message>
    <message>
        <location filename="../../app/annotator/panels.py"/>
        <source>no</source>
        <translation>否</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>In the picture, by mouse</source>
        <translation>在图像中，用鼠标</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Go</source>
        <translation>转到(&amp;G)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Edit</source>
        <translation>编辑(&amp;E)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Tools</source>
        <translation>工具(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Following the lines: {done} of {count} images</source>
        <translation>正在跟踪线：{count} 幅图像中的 {done} 幅</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>{count} edits could not be written.</source>
        <translation>{count} 处编辑无法写入。</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Answer: {answer}</source>
        <translation>答案：{answer}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Click, drag</source>
        <translation>单击，拖动</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>set a point; move one</source>
        <translation>放置点；移动点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Double click</source>
        <translation>双击</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>end the line</source>
        <translation>结束此线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Right click</source>
        <translation>右击</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>take a point out; brush, region, tube: take away</source>
        <translation>删除一点；画笔、区域、管：去除</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Wheel</source>
        <translation>滚轮</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>zoom at the cursor; brush, region, tube: size, with Ctrl zoom</source>
        <translation>在光标处缩放；画笔、区域、管：调大小，按 Ctrl 缩放</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Note on this image  (M)</source>
        <translation>本图像的备注  (M)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>LumenPilot — annotate {name}</source>
        <translation>LumenPilot — 标注 {name}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Image {place}</source>
        <translation>图像 {place}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>{name}   ({place} of {count})</source>
        <translation>{name}   （{place} / {count}）</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Report</source>
        <translation>报告</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>How well the raters agree, with each other and themselves</source>
        <translation>评估者彼此之间以及与自己的一致程度</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Next rater...</source>
        <translation>下一位评估者...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The same images for somebody else</source>
        <translation>同样的图像交给另一个人</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Evaluate</source>
        <translation>评估</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The algorithm against these answers, as a report</source>
        <translation>算法与这些答案的比较，作为报告</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Export...</source>
        <translation>导出...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Training set, table, or masks for other programs</source>
        <translation>训练集、表格，或供其他程序使用的掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Next rater</source>
        <translation>下一位评估者</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Who annotates next? Now it is {rater}.</source>
        <translation>接下来谁标注？现在是 {rater}。</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Enter takes {state}, as the lines say · or A B C D, X, O</source>
        <translation>回车采用线所示的 {state} · 或按 A B C D、X、O</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Algorithm: θ {theta:.1f}°, state {state}, confidence {confidence:.2f}. G takes it over</source>
        <translation>算法：θ {theta:.1f}°，状态 {state}，置信度 {confidence:.2f}。按 G 采用</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The algorithm gives no pose: {why}</source>
        <translation>算法没有给出位姿：{why}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Stop</source>
        <translation>停止</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>What was followed so far is kept</source>
        <translation>已跟踪的部分保留</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Proposed from {name}, dotted: G takes the masks over, V hides them</source>
        <translation>由 {name} 提出，虚线：G 采用这些掩膜，V 隐藏它们</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Not saved</source>
        <translation>未保存</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Free some space or put the disk back, and they are written by themselves.</source>
        <translation>腾出空间或放回磁盘，它们会自动写入。</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Stay</source>
        <translation>留下</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Leave without them</source>
        <translation>放弃并离开</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Open...</source>
        <translation>打开(&amp;O)...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Import...</source>
        <translation>导入(&amp;I)...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Export...</source>
        <translation>导出(&amp;E)...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Report of the raters</source>
        <translation>评估者报告(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Report of the &amp;algorithm</source>
        <translation>算法报告(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Next rater...</source>
        <translation>下一位评估者(&amp;N)...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Train on my annotations...</source>
        <translation>用我的标注训练(&amp;T)...</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Show where it is &amp;saved</source>
        <translation>显示保存位置(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Zoom &amp;in</source>
        <translation>放大(&amp;I)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Zoom &amp;out</source>
        <translation>缩小(&amp;O)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Close-up of the head, or the cursor</source>
        <translation>头部或光标处的放大图(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Whole picture</source>
        <translation>整幅图像(&amp;W)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Keep the zoom from picture to picture</source>
        <translation>逐幅图像保持缩放(&amp;K)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>More contrast</source>
        <translation>提高对比度</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Less contrast</source>
        <translation>降低对比度</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Brighter</source>
        <translation>更亮</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Darker</source>
        <translation>更暗</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Normal contrast and brightness</source>
        <translation>正常对比度和亮度(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Loupe</source>
        <translation>放大镜(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Masks</source>
        <translation>掩膜(&amp;M)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Algorithm</source>
        <translation>算法(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Next</source>
        <translation>下一项(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Previous</source>
        <translation>上一项(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Next &amp;without an answer</source>
        <translation>下一个未作答的(&amp;W)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;First</source>
        <translation>第一个(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Last</source>
        <translation>最后一个(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Lis&amp;t of images</source>
        <translation>图像列表(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Undo</source>
        <translation>撤销(&amp;U)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Redo</source>
        <translation>重做(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Note</source>
        <translation>备注(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Take the &amp;algorithm's lines, or mask</source>
        <translation>采用算法的线或掩膜(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Masks as in another image</source>
        <translation>与另一图像相同的掩膜(&amp;M)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Follow the &amp;lines through the clip</source>
        <translation>沿片段跟踪线(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>&amp;Fewer points on outlines</source>
        <translation>减少轮廓点数(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Circle smaller</source>
        <translation>缩小圆</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Circle larger</source>
        <translation>放大圆</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>image {place}</source>
        <translation>图像 {place}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>All {count} images have an answer</source>
        <translation>全部 {count} 幅图像都有答案</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Fewer points are for masks: 3 or 4 first</source>
        <translation>减少点数只用于掩膜：先按 3 或 4</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>A blind study: what the algorithm says is hidden</source>
        <translation>盲法研究：算法的结果被隐藏</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Finding the masks by those of {name}</source>
        <translation>正在根据 {name} 的掩膜寻找掩膜</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>{count} images have followed lines: correct one, and Ctrl+F follows from it</source>
        <translation>{count} 幅图像有跟踪的线：修正其中一幅，Ctrl+F 从它继续跟踪</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Nothing of it was found in this image</source>
        <translation>此图像中没有找到</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Every edit is saved at once, in {path}</source>
        <translation>每次编辑都立即保存在 {path}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Angle to the vessel</source>
        <translation>与血管的夹角</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>In the picture</source>
        <translation>在图像中</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The first image</source>
        <translation>第一张图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Now the state as you see it: A B C D, X or O</source>
        <translation>现在给出您看到的状态：A B C D、X 或 O</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Not complete: {missing}; or X, can't tell; or O, no robot</source>
        <translation>不完整：{missing}；或 X，无法判断；或 O，没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>A blind study: masks are drawn outside it</source>
        <translation>盲法研究：掩膜在研究之外绘制</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>No other image of this folder and size has a robot mask</source>
        <translation>此文件夹中没有其他同尺寸且带机器人掩膜的图像</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>A blind study: lines are drawn by hand in it</source>
        <translation>盲法研究：其中的线由手工绘制</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Draw both lines on an image of this folder first; the others get theirs from it</source>
        <translation>先在此文件夹的一幅图像上画两条线；其他图像由此得到</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The algorithm found no {what}</source>
        <translation>算法没有找到{what}</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The algorithm's lines are yours now: correct them, Enter goes on, Ctrl+Z takes them back</source>
        <translation>算法的线现在归您：修正它们，回车继续，Ctrl+Z 撤回</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The algorithm has no lines here</source>
        <translation>算法在此没有线</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>loading</source>
        <translation>正在加载</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>The last image. {left} without an answer: U goes there</source>
        <translation>最后一张图像。{left} 张未作答：按 U 前往</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>A blind study: choose the state yourself, A B C D</source>
        <translation>盲法研究：状态由您自己选择，A B C D</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>the outline's last point</source>
        <translation>轮廓的最后一点</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>this image cannot be shown</source>
        <translation>此图像无法显示</translation>
    </message>
    <message>
        <location filename="../../app/annotator/window.py"/>
        <source>Asking the algorithm</source>
        <translation>正在询问算法</translation>
    </message>
    <message>
        <location filename="../../app/commands/annotate.py"/>
        <source>study {name}, rater {rater}, blind</source>
        <translation>研究 {name}，标注者 {rater}，盲法</translation>
    </message>
    <message>
        <location filename="../../app/commands/annotate.py"/>
        <source>rater {rater}</source>
        <translation>标注者 {rater}</translation>
    </message>
    <message>
        <location filename="../../app/commands/session.py"/>
        <source>it is still being recorded: what came later is not in what was written</source>
        <translation>它仍在录制：之后的内容不在已写入的部分中</translation>
    </message>
    <message>
        <location filename="../../app/library/model.py"/>
        <source>Newest first</source>
        <translation>最新的在前</translation>
    </message>
    <message>
        <location filename="../../app/library/model.py"/>
        <source>Oldest first</source>
        <translation>最旧的在前</translation>
    </message>
    <message>
        <location filename="../../app/library/model.py"/>
        <source>Longest first</source>
        <translation>最长的在前</translation>
    </message>
    <message>
        <location filename="../../app/library/model.py"/>
        <source>Most faults first</source>
        <translation>故障最多的在前</translation>
    </message>
    <message>
        <location filename="../../app/library/model.py"/>
        <source>By operator</source>
        <translation>按操作者</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Mouse</source>
        <translation>鼠标</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>recording</source>
        <translation>正在录制</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>recorded with LumenPilot {program}</source>
        <translation>由 LumenPilot {program} 录制</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>faults: {faults}</source>
        <translation>故障：{faults}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>play the session</source>
        <translation>播放会话</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>no pose</source>
        <translation>无位姿</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Search</source>
        <translation>搜索</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>All tags</source>
        <translation>所有标签</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Tag</source>
        <translation>标签</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Order</source>
        <translation>顺序</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Sessions</source>
        <translation>会话</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Play</source>
        <translation>回放</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Annotate</source>
        <translation>标注</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Export</source>
        <translation>导出</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Session</source>
        <translation>会话</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>rig {name}</source>
        <translation>装置 {name}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Open a folder...</source>
        <translation>打开文件夹(&amp;O)...</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Session</source>
        <translation>会话(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>reading ...</source>
        <translation>正在读取……</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>{shown} of {count}</source>
        <translation>{count} 个中的 {shown} 个</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>LumenPilot — sessions in {folder}</source>
        <translation>LumenPilot — {folder} 中的会话</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>A folder with sessions</source>
        <translation>含会话的文件夹</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Exported: {path}</source>
        <translation>已导出：{path}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>not described</source>
        <translation>没有描述</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Search: operator, task, date, rig, #tag, fault ...</source>
        <translation>搜索：操作者、任务、日期、装置、#标签、故障……</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Export as .{ending}...</source>
        <translation>导出为 .{ending}...</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Play</source>
        <translation>播放(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Annotate</source>
        <translation>标注(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Describe</source>
        <translation>描述(&amp;D)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Show its &amp;folder</source>
        <translation>显示其文件夹(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Recover a copy</source>
        <translation>恢复副本(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>no session here</source>
        <translation>这里没有会话</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Recovering a copy: {name}</source>
        <translation>正在恢复副本：{name}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Recovered: {name}</source>
        <translation>已恢复：{name}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>Export {name}</source>
        <translation>导出 {name}</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Reload</source>
        <translation>重新读取(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>&amp;Search</source>
        <translation>搜索(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/library/window.py"/>
        <source>unknown</source>
        <translation>未知</translation>
    </message>
    <message>
        <location filename="../../app/operator/awake.py"/>
        <source>The screen may lock, or the computer sleep, while you drive: switch that off in the desktop's settings</source>
        <translation>驱动时屏幕可能锁定或计算机休眠：请在桌面设置中关闭</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Relax slowly</source>
        <translation>缓慢放松</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Hold</source>
        <translation>保持</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Torque off now</source>
        <translation>立即断开扭矩</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The servos hold</source>
        <translation>舵机仍在保持</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The servos hold the wires.</source>
        <translation>舵机仍拉着拉线。</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Relax slowly: the wires are let out at 1 mm/s, then the torque goes off.
Hold: they stay as they are; heat, supply and current are watched, and after {minutes:.0f} min they are relaxed.
Torque off now: the wires spring back at once.</source>
        <translation>缓慢放松：以 1 mm/s 放出拉线，然后断开扭矩。
保持：维持原状；监视温度、电源和电流，{minutes:.0f} 分钟后放松。
立即断开扭矩：拉线会立刻回弹。</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Do not close</source>
        <translation>不关闭</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The window stays open: disarm first (Shift+F6), or wait until the servos are ready</source>
        <translation>窗口保持打开：请先解除就绪（Shift+F6），或等到舵机空闲</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The wires are relaxed, then the window closes; STOP ends it</source>
        <translation>先放松拉线，然后关闭窗口；STOP 可中止</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The torque goes off, then the window closes</source>
        <translation>断开扭矩，然后关闭窗口</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Always so for this rig</source>
        <translation>此装置总是如此</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>Stopped: the window stays open, and the wires are as they were then</source>
        <translation>已停止：窗口保持打开，拉线维持当时的状态</translation>
    </message>
    <message>
        <location filename="../../app/operator/leaving.py"/>
        <source>The torque is not proven to be off: cut the servos' power</source>
        <translation>无法证实扭矩已断开：请切断舵机电源</translation>
    </message>
    <message>
        <location filename="../../app/operator/live_menu.py"/>
        <source>Stream for &amp;Foxglove</source>
        <translation>Foxglove 数据流(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/operator/live_menu.py"/>
        <source>Outlets for LS&amp;L</source>
        <translation>LSL 输出(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/operator/live_menu.py"/>
        <source>Live output: {address}</source>
        <translation>实时输出：{address}</translation>
    </message>
    <message>
        <location filename="../../app/operator/live_menu.py"/>
        <source>&amp;File</source>
        <translation>文件(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>the robot is armed: disarm it first</source>
        <translation>机器人处于待命：请先解除待命</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>stop: the rig that is being opened starts stopped</source>
        <translation>停止：正在打开的装置将以停止状态启动</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>stop: no rig is open, so nothing moves</source>
        <translation>停止：没有打开装置，所以没有东西会动</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>cleared</source>
        <translation>已清除</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>set to {x:.0f}, {y:.0f} px</source>
        <translation>设为 {x:.0f}, {y:.0f} px</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>restart servo {servo_id}</source>
        <translation>重启舵机 {servo_id}</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>zero {what}</source>
        <translation>归零：{what}</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>torque off</source>
        <translation>关闭力矩</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>Foot pedal: ready</source>
        <translation>脚踏板：就绪</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>servos on</source>
        <translation>开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>Gamepad: {name}</source>
        <translation>手柄：{name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/manual_drive.py"/>
        <source>Gamepad lost: {name}</source>
        <translation>手柄断开：{name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>not measured</source>
        <translation>未测量</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>pictures of {name}</source>
        <translation>张 {name} 图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source> on {count} {what}</source>
        <translation>（{count} {what}）</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>Use model {name} instead of {current}?</source>
        <translation>用模型 {name} 代替 {current}？</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>held-out pictures</source>
        <translation>张留出图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>state {share:.0f} %</source>
        <translation>状态 {share:.0f} %</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>confidence not calibrated</source>
        <translation>置信度未标定</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>, own</source>
        <translation>，自有</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>Use {name}</source>
        <translation>使用 {name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>Dice vessel {vessel}, robot {robot}</source>
        <translation>Dice 血管 {vessel}，机器人 {robot}</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>Teach this &amp;bench...</source>
        <translation>学习此台架(&amp;B)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>&amp;Model</source>
        <translation>模型(&amp;M)</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>The model stays {current}: {why}</source>
        <translation>仍用模型 {current}：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>a test set</source>
        <translation>测试集</translation>
    </message>
    <message>
        <location filename="../../app/operator/models.py"/>
        <source>No</source>
        <translation>否</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>No new picture for {seconds:.0f} s</source>
        <translation>已 {seconds:.0f} 秒没有新图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>This rig has no robot</source>
        <translation>此装置没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>The simulation waits for this computer, which is busy</source>
        <translation>仿真在等待这台繁忙的计算机</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>No new picture</source>
        <translation>没有新图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>The camera or the program is behind</source>
        <translation>相机或程序跟不上</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>No picture</source>
        <translation>没有画面</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>No picture from the camera</source>
        <translation>相机没有画面</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Performance</source>
        <translation>性能</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Last 30 seconds</source>
        <translation>最近 30 秒</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>the pose is not steady yet</source>
        <translation>位姿尚不稳定</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Starting</source>
        <translation>正在启动</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Starting: {what}</source>
        <translation>正在启动：{what}</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Opening camera and robot, loading the network</source>
        <translation>正在打开相机和机器人，加载网络</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Check the camera; F5 starts the rig again</source>
        <translation>检查相机；按 F5 重新启动装置</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Trends</source>
        <translation>趋势</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Move the robot</source>
        <translation>移动机器人</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>hold a key</source>
        <translation>按住一个键</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Drive</source>
        <translation>驾驶</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Servos</source>
        <translation>舵机</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Commands</source>
        <translation>指令</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Log</source>
        <translation>日志</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Waiting for the first picture</source>
        <translation>等待第一幅图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Recording is over</source>
        <translation>回放结束</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>F5 plays it again</source>
        <translation>按 F5 重新播放</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>Fault</source>
        <translation>故障</translation>
    </message>
    <message>
        <location filename="../../app/operator/panels.py"/>
        <source>The rig stopped</source>
        <translation>装置已停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Not armed yet: the checks before driving take some seconds, then arm again</source>
        <translation>暂未待命：驾驶前检查需几秒，之后请再次进入待命</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>no answer within {seconds:.0f} s</source>
        <translation>{seconds:.0f} 秒内无应答</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>The checks could not be made: {problem}</source>
        <translation>无法完成检查：{problem}</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Checking: {count} looked at</source>
        <translation>检查中：已查 {count} 项</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Not ready: {count} of {whole} checks stand against driving</source>
        <translation>未就绪：{whole} 项检查中有 {count} 项不允许驾驶</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Not checked yet</source>
        <translation>尚未检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>The checks are good, but not yet ready to arm: {why}</source>
        <translation>检查通过，但尚不能就绪：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Ready: {good} of {count} checks good</source>
        <translation>就绪：{count} 项检查中 {good} 项正常</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>camera's pictures</source>
        <translation>相机图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>servos' answers</source>
        <translation>舵机应答</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>rig</source>
        <translation>装置</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Not armed. {what} What to do: {fix}{more}</source>
        <translation>未待命。{what}处理：{fix}{more}</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Not ready: 1 of {whole} checks stands against driving</source>
        <translation>未就绪：{whole} 项检查中有 1 项不允许驾驶</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>, {warned} to note</source>
        <translation>，{warned} 项须注意</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>Checking before driving</source>
        <translation>正在进行驱动前检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>this takes some seconds; then press {key} to arm</source>
        <translation>需要几秒钟；然后按 {key} 就绪</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>What to do: {fix}</source>
        <translation>处理方法：{fix}</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>You steer</source>
        <translation>由您操纵</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>the checks before driving come first: {key}, some seconds, {key} again</source>
        <translation>先进行驱动前检查：按 {key}，等几秒，再按 {key}</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source> (+{count} more)</source>
        <translation> （另有 {count} 项）</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>they ended with exit code {code}</source>
        <translation>以退出码 {code} 结束</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight.py"/>
        <source>no fault</source>
        <translation>无故障</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>First the checks must be done</source>
        <translation>须先完成检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>good</source>
        <translation>正常</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>not used</source>
        <translation>未使用</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>notice</source>
        <translation>注意</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>NOT READY</source>
        <translation>未就绪</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>The checks take some seconds. Nothing moves by them.</source>
        <translation>检查需要几秒，不会有任何运动。</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>just now</source>
        <translation>刚刚</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>{minutes} min ago</source>
        <translation>{minutes} 分钟前</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>Checked {ago}</source>
        <translation>{ago}检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>There is nothing to arm: no servos are open</source>
        <translation>没有可待命的：舵机未打开</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>First mend what is NOT READY, and check again</source>
        <translation>请先解决“未就绪”的项目，再次检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>Before driving</source>
        <translation>驾驶前检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>Checks before driving</source>
        <translation>驾驶前检查</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>: too long ago</source>
        <translation>：时间过久</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>Check &amp;again</source>
        <translation>再次检查(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>A&amp;rm  (F6)</source>
        <translation>进入待命(&amp;R)  (F6)</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>&amp;Close</source>
        <translation>关闭(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/operator/preflight_list.py"/>
        <source>Check &amp;now</source>
        <translation>立即检查(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>Record</source>
        <translation>录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>F9 begins or ends a session</source>
        <translation>F9 开始或结束会话录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>F10 saves the last seconds without having recorded</source>
        <translation>F10 保存没有录制的最近几秒</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>M marks this moment with a number</source>
        <translation>M 用编号标记此刻</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>no picture yet</source>
        <translation>还没有图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>{value:.1f} GB free on the disk</source>
        <translation>磁盘剩余 {value:.1f} GB</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>{count} dropped</source>
        <translation>丢弃 {count} 帧</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>stopped: disk full</source>
        <translation>已停：磁盘已满</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>stopped</source>
        <translation>已停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/record_bar.py"/>
        <source>Recording</source>
        <translation>录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>{seconds:.1f} s are lost (rows: {rows}, pictures: {pictures})</source>
        <translation>丢失 {seconds:.1f} s（{rows} 行，{pictures} 张图像）</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>The next recordings, until you say otherwise</source>
        <translation>接下来的录制，直到您另作说明</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>nothing of it is lost</source>
        <translation>没有丢失任何内容</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Session saved</source>
        <translation>会话已保存</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>The algorithm against angles measured by hand, as a report</source>
        <translation>把算法与人工测量的角度比较，生成报告</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>{name}, in {parent}</source>
        <translation>{name}，位于 {parent}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>The annotator takes {frames} pictures, evenly over the session. Then evaluate again.</source>
        <translation>标注窗口从会话中均匀取 {frames} 幅图像。之后再次评估。</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Measure by hand: {frames} pictures, evenly over the session</source>
        <translation>人工测量：{frames} 张图像，均匀取自整个会话</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Nothing is being recorded that could be marked: F9 begins a session</source>
        <translation>当前没有在录制，无法标记：按 F9 开始会话</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Described: {name}</source>
        <translation>已描述：{name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>The next recordings will say so</source>
        <translation>接下来的录制会这样注明</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>A recording was cut</source>
        <translation>一段录制被中断</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>{count} recordings were cut</source>
        <translation>{count} 段录制被中断</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Describe</source>
        <translation>描述</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Operator, task, condition, tags</source>
        <translation>操作者、任务、条件、标签</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Evaluating {name}</source>
        <translation>正在评估 {name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>{answered} of {measured} pictures answered</source>
        <translation>{measured} 张图像中 {answered} 张有结果</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Nothing to save yet: record.ring_s is 0, or the rig has just been opened</source>
        <translation>尚无可保存内容：record.ring_s 为 0，或装置刚打开</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Not marked: the recorder is behind</source>
        <translation>未标记：录制器跟不上</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Noted: {text}</source>
        <translation>已记录：{text}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Mark {number} is in the session</source>
        <translation>标记 {number} 已写入会话</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Mark {number} is in the last seconds: F10 saves them</source>
        <translation>标记 {number} 在最近几秒中：按 F10 保存</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Session saved: {saved}</source>
        <translation>会话已保存：{saved}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Recording stopped: {problem}</source>
        <translation>录制停止：{problem}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Recover</source>
        <translation>恢复</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Make a whole copy beside each</source>
        <translation>在每段旁边生成一份完整副本</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Not now</source>
        <translation>暂不</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Ask again at the next start</source>
        <translation>下次启动时再问</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Never</source>
        <translation>不再提示</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Do not ask again for these</source>
        <translation>不再询问这些录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>{name}. The damaged original stays as it is.</source>
        <translation>{name}。损坏的原件保持不变。</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Recovered: {session}; {words}</source>
        <translation>已恢复：{session}；{words}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Recovered; {words}</source>
        <translation>已恢复；{words}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>The player, with everything as it was understood</source>
        <translation>打开回放器，显示当时理解的全部内容</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>An evaluation is running already</source>
        <translation>已有一个评估正在运行</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Nothing is measured by hand yet</source>
        <translation>还没有人工测量</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>No picture is measured to the end yet: both lines and a state, can't tell, or no robot</source>
        <translation>还没有图像测量完毕：两条线和一个状态、无法判断，或没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>a session is being recorded: end it first</source>
        <translation>正在录制会话：请先结束录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Cut sessions could not be looked for: {line}</source>
        <translation>无法查找中断的会话：{line}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>No cut session in {folder}</source>
        <translation>{folder} 中没有中断的会话</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>That you do not want to be asked could not be kept ({why})</source>
        <translation>“不再询问”未能保存（{why}）</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Not recovered: {why}. To try again: {menu}</source>
        <translation>未恢复：{why}。重试：{menu}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Evaluated: {judged}. Report opened: {report}</source>
        <translation>评估完成：{judged}。报告已打开：{report}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Evaluated: {judged}. The report is: {report}</source>
        <translation>评估完成：{judged}。报告位于：{report}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Not evaluated: {why}</source>
        <translation>未能评估：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/recording.py"/>
        <source>Look for &amp;cut sessions</source>
        <translation>查找中断的会话(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Rehearsing: {done} of {total}</source>
        <translation>正在预演：{done} / {total}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>{share:.0f} % of {runs} runs arrived</source>
        <translation>{runs} 次中 {share:.0f} % 到达</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>95 % interval {low:.0f} to {high:.0f} %</source>
        <translation>95 % 区间 {low:.0f} 至 {high:.0f} %</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Go at {share:.0f} % of the set speeds: advice.fast_mm_s = {speed:g}</source>
        <translation>以设定速度的 {share:.0f} % 行进：advice.fast_mm_s = {speed:g}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Close the rehearsal</source>
        <translation>关闭预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Rehearsal</source>
        <translation>预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Rehearse  ({key})</source>
        <translation>预演  ({key})</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Looking at the way: {share:.0f} %</source>
        <translation>正在查看路径：{share:.0f} %</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Cancel</source>
        <translation>取消</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>With the nominal robot: rig identify measures yours</source>
        <translation>使用标称机器人：rig identify 可测量您的机器人</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>{time:.0f} s (median)</source>
        <translation>{time:.0f} 秒（中位数）</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>wall force {p95:.2f} N, {max:.2f} N at most</source>
        <translation>壁面力 {p95:.2f} N，最大 {max:.2f} N</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>no answer in {share:.0f} % of the pictures</source>
        <translation>{share:.0f} % 的图像没有结果</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>A branch on the way turns off more sharply than the head bends</source>
        <translation>途中有一个分支的转角超过头部的弯曲能力</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>Too few runs ended to recommend a speed: close other programs, and rehearse again</source>
        <translation>结束的运行太少，无法推荐速度：请关闭其他程序后重新预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>No speed that was tried is good: choose another target, or steer yourself</source>
        <translation>试过的速度都不合适：请选择其他目标点，或自行操纵</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>The set speed is good</source>
        <translation>设定的速度合适</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>At {share:.0f} % of the set speeds: {done} of {total}</source>
        <translation>设定速度的 {share:.0f} %：{done} / {total}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsal_card.py"/>
        <source>wall force</source>
        <translation>壁面力</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>this target was not rehearsed</source>
        <translation>此目标点尚未预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>no phantom of this bench for the twin: teach the bench, or python main.py phantom BENCH</source>
        <translation>数字孪生没有此台架的体模：请示教台架，或运行 python main.py phantom BENCH</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>&amp;Robot</source>
        <translation>机器人(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>Not rehearsed: {why}</source>
        <translation>未预演：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>rehearsal</source>
        <translation>预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>press {key}: two minutes beside the window</source>
        <translation>按 {key}：在窗口旁运行约两分钟</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>First click the target, then rehearse</source>
        <translation>请先单击目标点，再预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>the rehearsal is not finished</source>
        <translation>预演尚未结束</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>wait for its result</source>
        <translation>请等待其结果</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>the hand-over needs one</source>
        <translation>移交需要预演</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>no target yet</source>
        <translation>尚无目标点</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>click it, and press {key}</source>
        <translation>单击目标点，然后按 {key}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>Not handed over: {what}. {fix}</source>
        <translation>未移交：{what}。{fix}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>Re&amp;hearse this target</source>
        <translation>预演此目标点(&amp;H)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rehearsing.py"/>
        <source>exit code {code}</source>
        <translation>退出码 {code}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Waiting for the wizard to give camera and servos back; where a driver hangs, start the program again</source>
        <translation>正在等待向导归还相机和舵机；如果驱动程序卡住，请重新启动程序</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>the rig wizard has camera and servos; the rig is opened again when it is closed</source>
        <translation>装置向导正在使用相机和舵机；向导关闭后装置会重新打开</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>The insertion port is at {x:.0f}, {y:.0f} px from now on</source>
        <translation>插入口从现在起位于 {x:.0f}, {y:.0f} px</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>C&amp;amera</source>
        <translation>相机(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Look at pictures instead of the camera's</source>
        <translation>查看图像而不是相机画面</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>a stop or fault is not acknowledged: acknowledge it first</source>
        <translation>有停止或故障未确认：请先确认</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>wait: {what}</source>
        <translation>请稍候：{what}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>The rig stays as it is: {why}</source>
        <translation>装置保持不变：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>The insertion port is forgotten</source>
        <translation>已忘记插入口</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>it has no file: save one first (menu Rig, New rig)</source>
        <translation>它没有文件：请先保存一个（菜单“装置”，“新建装置”）</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>a recording is played: start with a camera or the twin</source>
        <translation>正在播放录制内容：请以相机或数字孪生启动</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Ri&amp;g</source>
        <translation>装置(&amp;G)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Click where the robot is inserted; Esc leaves it as it is</source>
        <translation>请单击机器人的插入处；按 Esc 保持不变</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>the wizard knows DYNAMIXEL servos only: write the ids and signs of the joints into the rig file</source>
        <translation>向导只认识 DYNAMIXEL 舵机：请把各关节的 id 和符号写入装置文件</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>The rig was opened again meanwhile; ask for the wizard again</source>
        <translation>其间装置已重新打开；请再次打开向导</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Rig {name} saved</source>
        <translation>装置 {name} 已保存</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Open a picture or &amp;video...</source>
        <translation>打开图像或视频(&amp;V)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Open a &amp;folder of pictures...</source>
        <translation>打开图像文件夹(&amp;F)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>&amp;New rig...</source>
        <translation>新建装置(&amp;N)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>&amp;Calibrate...</source>
        <translation>标定(&amp;C)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>Set the insertion &amp;port...</source>
        <translation>设置插入口(&amp;P)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_menu.py"/>
        <source>&amp;Forget the insertion port</source>
        <translation>忘记插入口(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_session.py"/>
        <source>The servos were stopped</source>
        <translation>舵机已停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_session.py"/>
        <source>The rig that is being opened starts stopped</source>
        <translation>正在打开的台架将以停止状态启动</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_session.py"/>
        <source>No servos were in use, so there was nothing to stop</source>
        <translation>没有正在使用的舵机，因此无需停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/rig_session.py"/>
        <source>It is not certain that the servos were stopped: press Space</source>
        <translation>无法确定舵机是否已停止：请按空格键</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The rig is opened again: no picture for some seconds, and the servos must be switched on again.{ends}</source>
        <translation>装置将重新打开：几秒钟没有图像，且伺服须重新接通。{ends}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>An empty picture, the vessel's outline and a minute of moving the robot; then five minutes of waiting.</source>
        <translation>一张空台架图像、血管轮廓和一分钟的机器人移动；然后等待五分钟。</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The report is {report}</source>
        <translation>报告位于 {report}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The program met an error: {what}</source>
        <translation>程序遇到错误：{what}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>{what}. The report: {report}</source>
        <translation>{what}。报告：{report}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>A recorded session</source>
        <translation>已录制的会话</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>the program is armed; disarm first (Shift+F6)</source>
        <translation>程序处于待命；请先解除待命 (Shift+F6)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source> The recording ends.</source>
        <translation>录制将结束。</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Model {name} from now on, until the program ends</source>
        <translation>从现在到程序结束使用模型 {name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Annotations (*.sqlite)</source>
        <translation>标注 (*.sqlite)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Annotations to train on</source>
        <translation>用于训练的标注</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>another bench is in use: choose the one that was taught in the menu Rig or Twin first</source>
        <translation>正在使用另一台架：请先在“装置”或“数字孪生”菜单中选择所学习的台架</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Model {name} and its bench from now on; the menu Model has the one before</source>
        <translation>从现在起使用模型 {name} 及其台架；“模型”菜单中可选回之前的模型</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Look at it</source>
        <translation>查看</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Model {name} is installed; choose it in the Model menu</source>
        <translation>模型 {name} 已安装；请在“模型”菜单中选择</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Another unforeseen error: the servos were stopped again</source>
        <translation>又发生了意外错误：舵机已再次停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The report could not be written</source>
        <translation>报告无法写入</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Unforeseen error</source>
        <translation>意外错误</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>{stopped}. A recording that ran was ended and is whole.

{where}.

Best close the program and start it again. Space is still STOP.</source>
        <translation>{stopped}。正在进行的录制已结束，且保存完整。

{where}。

建议关闭程序后重新启动。空格键仍是急停。</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Close the program</source>
        <translation>关闭程序</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Go on</source>
        <translation>继续</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Show the report</source>
        <translation>显示报告</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Session &amp;library</source>
        <translation>会话库(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Describe the &amp;next recordings...</source>
        <translation>描述接下来的录制(&amp;N)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>&amp;Describe the newest session...</source>
        <translation>描述最新的会话(&amp;D)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>&amp;Annotate the newest session</source>
        <translation>标注最新会话(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Annotate its &amp;refused frames</source>
        <translation>标注其被拒绝的帧(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>&amp;Evaluate the newest session</source>
        <translation>评估最新会话(&amp;E)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>&amp;Play the newest session</source>
        <translation>回放最新会话(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>&amp;Open another session...</source>
        <translation>打开其他会话(&amp;O)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The last run of the program crashed</source>
        <translation>程序上次运行时崩溃</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>No session yet: F9 records one</source>
        <translation>还没有会话：按 F9 录制</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>A recording is played: start with a camera or the twin, or use the command teach</source>
        <translation>正在播放录制内容：请以相机或数字孪生启动，或使用命令 teach</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>This bench is taught: model {name}</source>
        <translation>此台架已学习：模型 {name}</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Teach this bench</source>
        <translation>学习此台架</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>The model does not know such pictures</source>
        <translation>模型不认识这类图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Chec&amp;ks before driving...</source>
        <translation>驾驶前检查(&amp;K)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Session saved. Who recorded it?</source>
        <translation>会话已保存。由谁录制？</translation>
    </message>
    <message>
        <location filename="../../app/operator/services.py"/>
        <source>Another bench is in use; this one is being trained: wait for it, or stop it</source>
        <translation>正在使用另一台架；此台架正在训练：请等待，或将其停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/startup.py"/>
        <source>&amp;Triggers from other programs...</source>
        <translation>来自其他程序的触发(&amp;T)...</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>The picture</source>
        <translation>图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>The robot comes in from the edge. The white ring is its head, the yellow arrow its direction, the blue line the vessel's centerline. Click into a branch: that is your target, Esc clears it. 1 to 9 and G switch what is drawn.</source>
        <translation>机器人从边缘进入。白圈是头端，黄箭头是其方向，蓝线是血管中心线。单击某个分支：那就是目标点，Esc 清除。1 至 9 和 G 切换所绘内容。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>How the head lies in the vessel</source>
        <translation>头端在血管中的位姿</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>A on course, B coming back to the centerline, C moving away from it, D crossed; the numbers that decided it stand beside it. Rest the mouse on a dial: it says what it means. When the program cannot tell, there is no letter but a reason.</source>
        <translation>A 在航线上，B 正回到中心线，C 正偏离中心线，D 已越过；旁边是判定所依据的数值。鼠标停在表盘上会说明其含义。程序无法判断时，不给字母，只给原因。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>What to do next</source>
        <translation>下一步做什么</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>How fast to advance and how far to turn, and why. It only advises: you steer. The purple ghost in the picture shows where the advice leads.</source>
        <translation>前进多快、转多少，以及为什么。它只给建议：由您操纵。图像中的紫色虚影显示按建议会到哪里。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>Keep it</source>
        <translation>保存下来</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>F9 records a session: every picture and all that was understood, advised, asked and sent. M marks a moment, F10 keeps the last seconds without a recording, P a snapshot. F1 shows all keys; Help, Tour shows this again.</source>
        <translation>F9 录制会话：每幅图像以及理解、建议、要求和发送的全部内容。M 标记此刻，F10 保存没有录制的最近几秒，P 截图。F1 显示所有按键；“帮助”中的“导览”可再次显示本导览。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>Move it yourself</source>
        <translation>亲手移动</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>Hold {advance}: the robot advances. {left} and {right} bend its head, {retract} retracts it, {straighten} straightens it. Let go and it stops. Try it: the tour waits.</source>
        <translation>按住 {advance}：机器人前进。{left} 和 {right} 使头端弯曲，{retract} 后退，{straighten} 回直。松开即停。试一试：导览会等待。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>Let the program drive</source>
        <translation>让程序驾驶</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>{arm} arms it; then hold {deadman}, the deadman, and press {hand_over}. Let go, and the robot holds. Any key that moves takes back at once, so does {take_back}. This bar always names the next step, and why it would be refused.</source>
        <translation>{arm} 进入待命；然后按住使能键 {deadman} 并按 {hand_over}。松开，机器人即保持。任何移动键都会立即收回控制，{take_back} 也是。此栏始终给出下一步，以及会被拒绝的原因。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>STOP</source>
        <translation>停止</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source>{stop} stops the robot, wherever you are in this program; so does this button, now as well. To go on: {acknowledge} acknowledges, {servos_on} switches the servos on. It is no emergency stop: that is the power cut beside the robot.</source>
        <translation>{stop} 在本程序任何地方都会停止机器人；此按钮也一样，现在也有效。要继续：{acknowledge} 确认，{servos_on} 开启舵机。它不是急停：急停是机器人旁的断电开关。</translation>
    </message>
    <message>
        <location filename="../../app/operator/tour.py"/>
        <source> or </source>
        <translation> 或 </translation>
    </message>
    <message>
        <location filename="../../app/operator/triggers.py"/>
        <source>not started</source>
        <translation>未启动</translation>
    </message>
    <message>
        <location filename="../../app/operator/triggers.py"/>
        <source>another window of the program has the socket</source>
        <translation>程序的另一个窗口占用了该套接字</translation>
    </message>
    <message>
        <location filename="../../app/operator/triggers.py"/>
        <source>No triggers from other programs: {why}</source>
        <translation>没有来自其他程序的触发：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/triggers.py"/>
        <source>Triggers from other programs: {path}; see main.py trigger --help</source>
        <translation>来自其他程序的触发：{path}；见 main.py trigger --help</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>Any of the ten &amp;families</source>
        <translation>十类外观中任意一类(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>&amp;Twin</source>
        <translation>数字孪生(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>Rarer loo&amp;ks</source>
        <translation>较少见的外观(&amp;K)</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>Look: {title}</source>
        <translation>外观：{title}</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>Another &amp;look</source>
        <translation>换一种外观(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>The look stays as it is: {why}</source>
        <translation>外观保持不变：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/twin_menu.py"/>
        <source>The phantom stays as it is: {why}</source>
        <translation>体模保持不变：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>Performance fi&amp;gures</source>
        <translation>性能数据(&amp;G)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>the picture is not live</source>
        <translation>当前不是实时图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>there is no picture yet</source>
        <translation>还没有图像</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>No snapshot: {why}</source>
        <translation>未截图：{why}</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>Snapshots go to {folder}</source>
        <translation>截图保存到 {folder}</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Snapshot</source>
        <translation>截图(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Open pictures folder</source>
        <translation>打开图片文件夹(&amp;O)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Record, or end the recording</source>
        <translation>开始或结束录制(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>Save the &amp;last seconds</source>
        <translation>保存最近几秒(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Mark this moment</source>
        <translation>标记此刻(&amp;M)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>S&amp;TOP</source>
        <translation>停止(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Clear target</source>
        <translation>清除目标(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>Start the &amp;rig again</source>
        <translation>重新启动装置(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/operator/window.py"/>
        <source>&amp;Tour</source>
        <translation>导览(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>{started:%Y-%m-%d %H:%M:%S}, rig {name}{how}</source>
        <translation>{started:%Y-%m-%d %H:%M:%S}，装置 {name}{how}</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Save the selection as a video, without one the session  (E)</source>
        <translation>把所选部分存为视频，未选则为整个会话  (E)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>{name}: its manifest is damaged</source>
        <translation>{name}：清单已损坏</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>, recovered</source>
        <translation>，已恢复</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Position in milliseconds</source>
        <translation>位置，毫秒</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Go to a time</source>
        <translation>转到某一时刻</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Time from the first frame; type one as 1:23.4 or in seconds, and press Enter  (key T)</source>
        <translation>从第一帧算起的时间；按 1:23.4 的形式或以秒为单位输入，然后按 Enter（T 键）</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Play or pause  (Space)</source>
        <translation>播放或暂停  (Space)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>What N and P jump to</source>
        <translation>N 和 P 跳转的类别</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>What N and P jump to  (K: the next kind)</source>
        <translation>N 和 P 跳转的类别  (K：下一类)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Speed</source>
        <translation>速度</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Speed  ([ slower, ] faster)</source>
        <translation>速度  ([ 减速，] 加速)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Clip</source>
        <translation>片段</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Note</source>
        <translation>备注</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Add a note at this time  (M)</source>
        <translation>在此刻加备注  (M)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Snapshot</source>
        <translation>截图</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Save this picture  (Ctrl+S)</source>
        <translation>保存此图像  (Ctrl+S)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>of {time}</source>
        <translation>/ {time}</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>One frame back  (←)</source>
        <translation>后退一帧  (←)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>One frame on  (→)</source>
        <translation>前进一帧  (→)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>To the previous one of the kind beside  (P)</source>
        <translation>到旁边所示种类的上一个  (P)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>To the next one of the kind beside  (N)</source>
        <translation>到旁边所示种类的下一个  (N)</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Events of the session</source>
        <translation>会话的事件</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>, being recorded</source>
        <translation>，正在录制</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>, cut off</source>
        <translation>，被截断</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>frame {place} of {count}</source>
        <translation>第 {place} / {count} 帧</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>no frames</source>
        <translation>没有图像</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Pause</source>
        <translation>暂停</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>Clip {seconds:.1f} s</source>
        <translation>片段 {seconds:.1f} 秒</translation>
    </message>
    <message>
        <location filename="../../app/player/controls.py"/>
        <source>recorded {kind}</source>
        <translation>录制 {kind}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>hollow triangle</source>
        <translation>空心三角</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>State change</source>
        <translation>状态变化</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Override</source>
        <translation>人工接管</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Mode</source>
        <translation>模式</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Target</source>
        <translation>目标</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Gap</source>
        <translation>缺口</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Difference</source>
        <translation>差异</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>Any event</source>
        <translation>任何事件</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>{skipped} skipped for newer ones, {lost} lost by the camera</source>
        <translation>{skipped} 帧因有更新的而跳过，相机丢失 {lost} 帧</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>{camera}, {count} by the recorder</source>
        <translation>{camera}，录制器丢弃 {count} 帧</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>rehearsal: {where}, {along:.0f} mm in; the runs were there after {time:.1f} s, with up to {force:.2f} N at the wall</source>
        <translation>预演：{where}，已进入 {along:.0f} mm；各次运行在 {time:.1f} 秒后到达此处，壁面力最大 {force:.2f} N</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>dropped</source>
        <translation>丢弃</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>lost by the camera</source>
        <translation>相机丢失</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>mode</source>
        <translation>模式</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>alert</source>
        <translation>警报</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>target</source>
        <translation>目标</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>override</source>
        <translation>人工接管</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>fault</source>
        <translation>故障</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>note</source>
        <translation>备注</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>frame {index} of the camera, captured at {time:.3f} s, {size} px</source>
        <translation>相机第 {index} 帧，采集于 {time:.3f} s，{size} px</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>{rate:.1f} frames per second, {dropped}</source>
        <translation>每秒 {rate:.1f} 帧，{dropped}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>rehearsal: the head is not on the way yet</source>
        <translation>预演：头部尚未进入路径</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>{px:.0f} px outside the band</source>
        <translation>超出范围带 {px:.0f} px</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>within the band</source>
        <translation>在范围带内</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>confidence {confidence:.2f}, crossed {crossed}</source>
        <translation>置信度 {confidence:.2f}，越过：{crossed}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>no way to the target: {why}</source>
        <translation>无路可达目标：{why}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>insertion {insertion:.1f} mm, sheath {sheath:.1f} mm</source>
        <translation>进深 {insertion:.1f} mm，鞘管 {sheath:.1f} mm</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>against arming: {reason}</source>
        <translation>不能待命：{reason}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>distance from the kinds of pictures that the model knows {novelty:.2f}</source>
        <translation>与模型已知图像类型的距离 {novelty:.2f}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>servo bus</source>
        <translation>舵机总线</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>perception {total:.1f} ms: </source>
        <translation>感知 {total:.1f} ms：</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>no pose: {why}</source>
        <translation>无位姿：{why}</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>tendons: </source>
        <translation>驱动丝：</translation>
    </message>
    <message>
        <location filename="../../app/player/course.py"/>
        <source>fault: {cause}: {detail}</source>
        <translation>故障：{cause}：{detail}</translation>
    </message>
    <message>
        <location filename="../../app/player/replayed.py"/>
        <source>state {before} → {after}</source>
        <translation>状态 {before} → {after}</translation>
    </message>
    <message>
        <location filename="../../app/player/replayed.py"/>
        <source>{states}: no pose, {why}</source>
        <translation>{states}：无位姿，{why}</translation>
    </message>
    <message>
        <location filename="../../app/player/replayed.py"/>
        <source>, head {distance:.1f} px away</source>
        <translation>，头端相差 {distance:.1f} px</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>there are pictures, but no rows: repair it with: session recover</source>
        <translation>有图像但没有数据行：用 session recover 修复</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>{count} rows are missing between those that are there</source>
        <translation>其间缺少 {count} 行</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>{count} frames could not be recorded: the recorder was behind</source>
        <translation>{count} 帧未能录制：录制器跟不上</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>the session did not end properly; session recover makes a repaired copy</source>
        <translation>会话没有正常结束；session recover 可生成修复的副本</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>No angles by hand: {why}</source>
        <translation>没有人工测量的角度：{why}</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>it is empty</source>
        <translation>内容为空</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>{count} results of the replay cannot be read</source>
        <translation>重新感知的 {count} 个结果无法读取</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>Kept beside the session</source>
        <translation>保存在会话旁</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>Note kept</source>
        <translation>备注已保存</translation>
    </message>
    <message>
        <location filename="../../app/player/session_model.py"/>
        <source>This session is still being recorded: what came later is not shown</source>
        <translation>此会话仍在录制：之后的内容不显示</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>Timeline</source>
        <translation>时间轴</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>empty</source>
        <translation>空</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>, {count} gaps</source>
        <translation>，{count} 个缺口</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>; selected {first} to {last}</source>
        <translation>；已选 {first} 至 {last}</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>{length} long, {count} marks{gaps}{chosen}</source>
        <translation>长 {length}，{count} 个标记{gaps}{chosen}</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>events</source>
        <translation>事件</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>state</source>
        <translation>状态</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>state {state}</source>
        <translation>状态 {state}</translation>
    </message>
    <message>
        <location filename="../../app/player/timeline.py"/>
        <source>by hand {angle}</source>
        <translation>人工 {angle}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Mouse and focus</source>
        <translation>鼠标与焦点</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Played back, not live</source>
        <translation>回放，非实时</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Jump to: {kind}</source>
        <translation>跳转到：{kind}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>on the timeline: go there</source>
        <translation>在时间轴上：转到</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Shift+drag</source>
        <translation>Shift+拖动</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>on the timeline: select</source>
        <translation>在时间轴上：选择</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>on the timeline or picture: zoom</source>
        <translation>在时间轴或图像上：缩放</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Tab, Enter</source>
        <translation>Tab，Enter</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>go to a control, press it</source>
        <translation>移到控件并按下</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>close, cancel, unselect</source>
        <translation>关闭、取消、取消选择</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Recorded picture</source>
        <translation>录制的图像</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Recorded values</source>
        <translation>记录值</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Problems of the session</source>
        <translation>会话的问题</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Note at this time; Enter keeps it, Esc does not</source>
        <translation>此刻的备注；Enter 保存，Esc 取消</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>mode when it was recorded</source>
        <translation>录制时的模式</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>The same picture perceived again</source>
        <translation>同一图像的重新感知</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>PERCEIVED AGAIN</source>
        <translation>重新感知</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Recorded against perceived again</source>
        <translation>录制结果与重新感知对比</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Events</source>
        <translation>事件</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Values</source>
        <translation>数值</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Problems</source>
        <translation>问题</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>none was recorded</source>
        <translation>未录制</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>this row was not</source>
        <translation>此行未重新感知</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>This picture is lost</source>
        <translation>此图像已丢失</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>This row is damaged</source>
        <translation>此行已损坏</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Row {row}; the problems page names it</source>
        <translation>第 {row} 行；“问题”页有说明</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Go on with the arrow keys</source>
        <translation>用方向键继续</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>LumenPilot — PLAYBACK of {name}</source>
        <translation>LumenPilot — 回放 {name}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Opening</source>
        <translation>正在打开</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>N and P: {kind}</source>
        <translation>N 和 P：{kind}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>A session, or a folder of pictures</source>
        <translation>会话，或图像文件夹</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Export the session as</source>
        <translation>会话导出为</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Open its folder</source>
        <translation>打开其文件夹</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Open it</source>
        <translation>打开</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No frame without a pose here</source>
        <translation>此处没有无位姿的帧</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No difference here</source>
        <translation>此处没有差异</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>E&amp;xport...</source>
        <translation>导出(&amp;X)...</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Selection as &amp;video</source>
        <translation>所选部分存为视频(&amp;V)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>&amp;Annotate this frame</source>
        <translation>标注此帧(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Annotate &amp;refused frames</source>
        <translation>标注被拒绝的帧(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Annotate frames evenly over the session</source>
        <translation>在会话中均匀取帧标注</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Report of the algorithm</source>
        <translation>算法报告</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>&amp;Describe the session...</source>
        <translation>描述会话(&amp;D)...</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Zoom the timeline &amp;in</source>
        <translation>放大时间轴(&amp;I)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Zoom the timeline &amp;out</source>
        <translation>缩小时间轴(&amp;O)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>The whole &amp;session</source>
        <translation>整个会话(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>&amp;Play or pause</source>
        <translation>播放或暂停(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>One frame back</source>
        <translation>后退一帧</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>One frame on</source>
        <translation>前进一帧</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>One second back</source>
        <translation>后退一秒</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>One second on</source>
        <translation>前进一秒</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Ten seconds back</source>
        <translation>后退十秒</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Ten seconds on</source>
        <translation>前进十秒</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>First frame</source>
        <translation>第一帧</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Last frame</source>
        <translation>最后一帧</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Go to a &amp;time</source>
        <translation>转到时间(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Slower</source>
        <translation>减速</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Faster</source>
        <translation>加速</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Speed as &amp;recorded</source>
        <translation>按录制的速度(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Jump to the next &amp;kind of thing</source>
        <translation>跳到下一个同类事件(&amp;K)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>&amp;Events</source>
        <translation>事件(&amp;E)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Selection &amp;from here</source>
        <translation>从此处开始选择(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Selection &amp;to here</source>
        <translation>选择到此处(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No selection</source>
        <translation>取消选择</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>PLAYBACK</source>
        <translation>回放</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>perceived again:</source>
        <translation>重新感知：</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Nothing was found to be wrong.</source>
        <translation>没有发现问题。</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>⚠ Problems {count}</source>
        <translation>⚠ 问题 {count}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Passed over a gap: {seconds:.1f} s without frames</source>
        <translation>跳过缺口：{seconds:.1f} 秒没有图像</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No {kind} after this frame</source>
        <translation>此帧之后没有{kind}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No {kind} before this frame</source>
        <translation>此帧之前没有{kind}</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No clip: there are no frames</source>
        <translation>没有片段：没有图像</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>No snapshot: there is no picture</source>
        <translation>没有截图：没有图像</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>{name} is being written already</source>
        <translation>{name} 已在写入</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Playing ended</source>
        <translation>播放已结束</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Nothing to play</source>
        <translation>没有可播放的内容</translation>
    </message>
    <message>
        <location filename="../../app/player/window.py"/>
        <source>Annotate the &amp;differences</source>
        <translation>标注差异(&amp;D)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Camera</source>
        <translation>相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>What is the rig called, and which camera looks at it? Open it: the picture on the right must be sharp and steady.</source>
        <translation>装置叫什么名字，用哪个相机观察？打开它：右边的图像必须清晰稳定。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Scale and lens</source>
        <translation>比例与镜头</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Print the board at 100 %, lay it flat at the height of the robot, and take three pictures or more: in the middle, then towards the corners. In the twin it is laid for you. Or click on the two ends of a length that you know.</source>
        <translation>按 100 % 打印标定板，平放在机器人的高度，拍三张或更多：先中间，再向四角。数字孪生会自动摆好。也可以单击一段已知长度的两端。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>{name}; only for real cameras</source>
        <translation>{name}；仅用于真实相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>{count} pictures of the board taken</source>
        <translation>已拍标定板图像 {count} 张</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Scale: {mm_per_px:.4f} mm per pixel, ±{share:.2f} % (by {method}).</source>
        <translation>比例：每像素 {mm_per_px:.4f} mm，±{share:.2f} %（{method}）。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>PDF (*.pdf);;PNG (*.png)</source>
        <translation>PDF (*.pdf);;PNG (*.png)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Name of the rig</source>
        <translation>装置的名称</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Cameras</source>
        <translation>相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Pictures per second</source>
        <translation>每秒图像数</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Open the camera</source>
        <translation>打开相机(&amp;O)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Search again</source>
        <translation>重新搜索(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Look for cameras and ports once more</source>
        <translation>再次查找相机和端口</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>looking for cameras</source>
        <translation>正在查找相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Opening the camera. The first time the network is loaded, too.</source>
        <translation>正在打开相机。第一次还要加载网络。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Give the rig a name.</source>
        <translation>请给装置起一个名称。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Side of a square</source>
        <translation>方格边长</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Length between the two clicks</source>
        <translation>两次单击之间的长度</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Take a picture</source>
        <translation>拍一张(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Calculate</source>
        <translation>计算(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Start &amp;over</source>
        <translation>重新开始(&amp;O)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Print...</source>
        <translation>打印(&amp;P)...</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Save the board as PDF or PNG</source>
        <translation>把标定板存为 PDF 或 PNG</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Click both en&amp;ds</source>
        <translation>单击两端(&amp;D)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Lens: k1 {k1:+.3f}, k2 {k2:+.3f}; from now on pictures are straightened.</source>
        <translation>镜头：k1 {k1:+.3f}，k2 {k2:+.3f}；今后图像会被校直。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Save the board</source>
        <translation>保存标定板</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>{path}: print it on {paper} at 100 %, and measure its line of 100 mm</source>
        <translation>{path}：按 100 % 打印在 {paper} 上，并测量其 100 mm 线</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Width</source>
        <translation>宽度</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Height</source>
        <translation>高度</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Name</source>
        <translation>名称(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>&amp;Picture</source>
        <translation>图像(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Next goes on when the camera is open.</source>
        <translation>打开相机后才能进入下一项。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>There is a rig {name}: saving replaces it, and keeps the older one beside it.</source>
        <translation>已有装置 {name}：保存会替换它，旧的保留在旁边。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Open the camera again and lose what was found?</source>
        <translation>重新打开相机并丢弃找到的结果？</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Open</source>
        <translation>打开</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Board, squares of</source>
        <translation>标定板，方格边长</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Known length</source>
        <translation>已知长度</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>1 picture of the board taken</source>
        <translation>已拍标定板图像 1 张</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Not calibrated yet: distances are shown in pixels only.</source>
        <translation>尚未标定：距离只以像素显示。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>Lens: straight enough; pictures are left as they are.</source>
        <translation>镜头：足够直；图像保持原样。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>looking for the board</source>
        <translation>正在寻找标定板</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>calculating</source>
        <translation>正在计算</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/camera_pages.py"/>
        <source>click on both ends of the known length</source>
        <translation>请单击已知长度的两端</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/model.py"/>
        <source>opening the camera</source>
        <translation>正在打开相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/pages_base.py"/>
        <source>Camera picture</source>
        <translation>相机图像</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/pages_base.py"/>
        <source>Steps</source>
        <translation>步骤</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/pages_base.py"/>
        <source>&amp;Back</source>
        <translation>上一项(&amp;B)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>One camera cannot tell up from down. Choose {joint}, wiggle it and look from the side: does the head rise when the wire is pulled? Without an answer the order of their ids counts, and the rig file says that it is assumed.</source>
        <translation>一台相机分不清上下。选择“{joint}”，摆动它并从侧面观察：拉丝时头端是否上抬？若不回答，则按 id 的顺序，装置文件会注明是假定的。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Nothing shows which way the shaft turns: wiggle it. With + its right side goes towards the camera. With tendons up and down a wrong direction shows when the steering is learnt, and the other one is taken.</source>
        <translation>画面看不出轴的转动方向：请摆动它。按 + 时其右侧朝相机转动。若有上下驱动丝，学习转向时会发现方向错误，并改用相反方向。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>tendon right</source>
        <translation>驱动丝 右</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>tendon left</source>
        <translation>驱动丝 左</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>tendon up</source>
        <translation>驱动丝 上</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>tendon down</source>
        <translation>驱动丝 下</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>robot forward</source>
        <translation>机器人前进</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>catheter, first</source>
        <translation>鞘管，第一</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>catheter, second</source>
        <translation>鞘管，第二</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Port and servos</source>
        <translation>端口与舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Which port are the servos connected to? Switch their 12 V supply on. Searching asks every servo on the line for its number and model; nothing moves. Without servos the rig only looks.</source>
        <translation>舵机接在哪个端口？请接通它们的 12 V 电源。搜索会询问线上每个舵机的编号和型号，不会有任何运动。没有舵机时，装置只观察。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Drums</source>
        <translation>绕线轮</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Measure with a caliper what the servos turn: the drums of the wires, with the wire on them, and the wheels of feed and delivery. Ways, speeds and the greatest force of each joint follow from it. Of a lead screw enter its way per turn.</source>
        <translation>用卡尺测量舵机所转之物：拉线的绕线轮（带线测量），以及进给和输送的轮子。各关节的行程、速度和最大力由此得出。丝杠请输入其每转行程。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Wiggle and direction</source>
        <translation>摆动与方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Each servo is turned by 0.75 mm both ways, and farther (3 mm at most) where nothing is seen. Hands off the wires. The robot's head must be in the picture, with room on both sides. STOP (Space) ends it at any moment. By hand: wiggle one, watch, and say what it is.</source>
        <translation>每个舵机来回转动 0.75 mm，看不出时再多（最多 3 mm）。手不要碰驱动丝。机器人头端必须在图像中，两侧留有空间。按停止（空格）随时可结束。手动方式：摆动一个，观察，然后说明它是哪个。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Zero and pretension</source>
        <translation>零位与预紧</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Each wire is loosened by 1.25 mm and then pulled in steps of 0.25 mm until the head follows, by 4 mm and with its greatest force at most; there it is left, taut and without tension: zero. A wire that the camera cannot judge is set by eye: choose it, and tighten or loosen it.</source>
        <translation>每根拉线先放松 1.25 mm，再以 0.25 mm 的步长拉紧，直到头端跟随，最多 4 mm，且不超过其最大力；停在绷紧但无张力处：即零点。相机无法判断的拉线按目视设置：选中它，再拉紧或放松。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Steering</source>
        <translation>转向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>From where the page before has left the wires the tendons bend the head to each side, up and down, by 0.3 mm at first and 1.2 mm at most, until it has shown its way. The robot must have room on both sides.</source>
        <translation>从上一页留下的驱动丝位置出发，各驱动丝使头端向两侧及上下弯曲，先 0.3 mm，至多 1.2 mm，直到看出其方向。机器人两侧须留有空间。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>rotation</source>
        <translation>旋转</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Greatest force, limited in the servos: {forces} N.</source>
        <translation>最大力，在舵机内限制：{forces} N。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Turn the servo of the chosen row both ways by 1.5 mm</source>
        <translation>把所选行的舵机来回转动 1.5 mm</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>set by hand</source>
        <translation>手动设定</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Servo port</source>
        <translation>舵机端口</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Servos found</source>
        <translation>找到的舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>no servos: look only</source>
        <translation>没有舵机：只观察</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>{count} servos at {baud} baud.</source>
        <translation>{baud} 波特，{count} 个舵机。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>searching the servos</source>
        <translation>正在搜索舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Tendons</source>
        <translation>拉线</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Robot forward</source>
        <translation>机器人前进</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Catheter</source>
        <translation>导管</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Joint</source>
        <translation>关节</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>ID</source>
        <translation>ID</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Direction</source>
        <translation>方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Seen</source>
        <translation>所见</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Joints and their servos</source>
        <translation>关节及其舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>telling the servos apart</source>
        <translation>正在区分舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Find automatically</source>
        <translation>自动寻找(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Wiggle the chosen</source>
        <translation>摆动所选(&amp;W)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Swap &amp;up and down</source>
        <translation>交换上下(&amp;U)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>One camera cannot tell them apart</source>
        <translation>一台相机无法区分它们</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Yes, it is so</source>
        <translation>是的，确实如此(&amp;Y)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>What was assumed is right as it stands in the table</source>
        <translation>表中所假定的内容是正确的</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Servo of {joint}</source>
        <translation>{joint}的舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Number of the servo on the bus</source>
        <translation>舵机在总线上的编号</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Direction of {joint}</source>
        <translation>{joint}的方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Which way the servo turns to pull the wire, or to go forward: + as it counts, − against it</source>
        <translation>拉紧驱动丝或前进时舵机的转向：+ 为其计数方向，− 为相反方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>swapped by hand</source>
        <translation>手动交换</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>looking where the wires are taut</source>
        <translation>正在寻找驱动丝的绷直位置</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Tendon to set by eye</source>
        <translation>目测设定的驱动丝</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Tighten {step:g} mm</source>
        <translation>拉紧 {step:g} mm(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Loosen {step:g} mm</source>
        <translation>放松 {step:g} mm(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Pretension</source>
        <translation>预紧</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Pull of every wire while the robot is straight, so that none hangs</source>
        <translation>机器人伸直时每根驱动丝的牵拉量，使其不松垂</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Slack of the tendons</source>
        <translation>驱动丝的松弛量</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>moving {joint}</source>
        <translation>正在移动{joint}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>learning the steering</source>
        <translation>正在学习转向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>&amp;Learn</source>
        <translation>学习(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Tendon</source>
        <translation>驱动丝</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Direction of the head</source>
        <translation>头端方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Way per mm of wire</source>
        <translation>每 mm 驱动丝的位移</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Steering directions</source>
        <translation>转向方向</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Directions in the picture: 0° to the right, 90° down.</source>
        <translation>图像中的方向：0° 向右，90° 向下。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Port</source>
        <translation>端口</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Model</source>
        <translation>模型</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>the twin's own servos</source>
        <translation>数字孪生自带的舵机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Slow: {what}; {fix}.</source>
        <translation>慢：{what}；{fix}。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>a rig without servos: the pages about servos have nothing to do</source>
        <translation>没有舵机的装置：有关舵机的页面无须操作</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Diameter, {what}</source>
        <translation>直径，{what}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Way per turn, {what}</source>
        <translation>每转行程，{what}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Before all of them are known no servo is moved.</source>
        <translation>在全部识别之前，不会移动任何舵机。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Search the servos first.</source>
        <translation>请先搜索舵机。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Not told apart yet; what stands in the table is the configuration's.</source>
        <translation>尚未区分；表中为配置的内容。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>wiggling servo {servo_id}</source>
        <translation>正在摆动舵机 {servo_id}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Was slack by</source>
        <translation>原松弛量</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>out of the picture</source>
        <translation>指向图像之外</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>The robot is rolled by {roll:+.0f}°: turn it by {turn:+.0f}° in its holder, and learn again.</source>
        <translation>机器人滚转了 {roll:+.0f}°：在夹持器中转动 {turn:+.0f}°，再学习一次。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>Way and heading disagree by {angle:.0f}°: does the head lie against a wall?</source>
        <translation>位移与朝向相差 {angle:.0f}°：头端是否贴靠管壁？</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>way per turn</source>
        <translation>每转行程</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source>The servos were not told apart: the configuration's ids and directions are used.</source>
        <translation>舵机尚未区分：使用配置中的 id 和方向。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/servo_pages.py"/>
        <source> (assumed)</source>
        <translation>（假定）</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>Save</source>
        <translation>保存</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>This is what will be saved. A step that was left out can be done later: menu Rig, Calibrate.</source>
        <translation>以下内容将被保存。略过的步骤可以以后再做：菜单“装置”中的“标定”。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>The rig as it will be saved</source>
        <translation>将要保存的装置</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>No camera yet</source>
        <translation>还没有相机</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>Saved: {path}</source>
        <translation>已保存：{path}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>The zeros are offered whenever the servos are switched on; say then how far robot and catheter are in.</source>
        <translation>每次开启舵机时都会提供零点；届时请说明机器人和导管插入多深。</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>Calibrate {name}</source>
        <translation>标定 {name}</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>New rig</source>
        <translation>新建装置</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>&amp;Save</source>
        <translation>保存(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>Leave without saving what was found?</source>
        <translation>不保存已找到的结果就离开吗？</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>Leave</source>
        <translation>离开</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>&amp;Skip</source>
        <translation>跳过(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/rig_wizard/wizard.py"/>
        <source>this page</source>
        <translation>本页</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>The robot is armed: settings can be changed when it is disarmed</source>
        <translation>机器人处于待命：解除待命后才能更改设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>A session is being recorded: settings can be changed when it has ended</source>
        <translation>正在录制会话：结束后才能更改设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>Save or cancel the settings first</source>
        <translation>请先保存或取消设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>The session goes on with the thresholds that it was begun with</source>
        <translation>会话继续使用开始时的阈值</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>Not while settings are tried out: save or cancel them first</source>
        <translation>正在试用设置：请先保存或取消</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>Settings saved in {path}</source>
        <translation>设置已保存在 {path}</translation>
    </message>
    <message>
        <location filename="../../app/settings/apply.py"/>
        <source>S&amp;ettings...</source>
        <translation>设置(&amp;E)...</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Settings of the section</source>
        <translation>本节的设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Reset section</source>
        <translation>重置本节</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Reset section {title}</source>
        <translation>重置分节 {title}</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>LumenPilot — settings</source>
        <translation>LumenPilot — 设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Put all settings back to their defaults?</source>
        <translation>把所有设置恢复为默认值？</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Reset all</source>
        <translation>全部重置</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Saved in {path}</source>
        <translation>保存在 {path}</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>{count} not saved</source>
        <translation>{count} 项未保存</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Nothing has {words} in its name, meaning or unit</source>
        <translation>没有设置的名称、含义或单位包含 {words}</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Search (Ctrl+F); Space may be STOP</source>
        <translation>搜索 (Ctrl+F)；空格键可能是 STOP</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Search name, meaning, unit (Ctrl+F); Space is STOP while the robot can move</source>
        <translation>搜索名称、含义、单位 (Ctrl+F)；机器人可动时空格即停止</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Search settings</source>
        <translation>搜索设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Sections</source>
        <translation>分节</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>State of the settings</source>
        <translation>设置的状态</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Kept in the rig file {path}: change it there, or by menu Rig, Calibrate</source>
        <translation>保存在装置文件 {path} 中：请在该文件中修改，或用菜单“装置”中的“标定”</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Save, and start the rig again</source>
        <translation>保存并重新启动装置</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>the picture shows it already; Cancel puts it back</source>
        <translation>图像已按此显示；取消可恢复</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>some act when the rig is started again</source>
        <translation>部分在装置重新启动后生效</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>some when the program is started again</source>
        <translation>部分在程序重新启动后生效</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>{count} more: add a word</source>
        <translation>还有 {count} 项：请再加一个词</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Reset section ({count})</source>
        <translation>重置本节（{count}）</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>{count} differ from the default</source>
        <translation>{count} 项与默认值不同</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>as by default</source>
        <translation>均为默认值</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>something is not allowed</source>
        <translation>有不允许的内容</translation>
    </message>
    <message>
        <location filename="../../app/settings/dialog.py"/>
        <source>Leave without saving the changes?</source>
        <translation>不保存更改就离开吗？</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>; allowed: {range}</source>
        <translation>；允许：{range}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>Joint {name}</source>
        <translation>关节 {name}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>not a finite number{allowed}</source>
        <translation>不是有限数值{allowed}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>must be a whole number{allowed}</source>
        <translation>必须是整数{allowed}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>must be {range}</source>
        <translation>必须为 {range}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>must be one of: {range}</source>
        <translation>必须是以下之一：{range}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>must not be empty{allowed}</source>
        <translation>不能为空{allowed}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>not a number{allowed}</source>
        <translation>不是数字{allowed}</translation>
    </message>
    <message>
        <location filename="../../app/settings/draft.py"/>
        <source>has not the right form: {description}</source>
        <translation>格式不对：{description}</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>not set</source>
        <translation>未设置</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>All files (*)</source>
        <translation>所有文件 (*)</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Pictures to play</source>
        <translation>要播放的图像</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Rig file</source>
        <translation>装置文件</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Model folder</source>
        <translation>模型文件夹</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Folder for snapshots</source>
        <translation>截图文件夹</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Folder for sessions</source>
        <translation>会话文件夹</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Rigs (*.toml)</source>
        <translation>装置 (*.toml)</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Browse...</source>
        <translation>浏览...</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Browse for {title}</source>
        <translation>浏览：{title}</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>{title}: choose it on the disk</source>
        <translation>{title}：在磁盘上选择</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Reset</source>
        <translation>重置</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Back to the default: {default}</source>
        <translation>恢复默认值：{default}</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Reset {title} to {default}</source>
        <translation>把 {title} 重置为 {default}</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>{title}, as a slider</source>
        <translation>{title}，滑块</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>Default {default}</source>
        <translation>默认 {default}</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>&amp;File...</source>
        <translation>文件(&amp;F)...</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>F&amp;older...</source>
        <translation>文件夹(&amp;O)...</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>on</source>
        <translation>开</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>off</source>
        <translation>关</translation>
    </message>
    <message>
        <location filename="../../app/settings/fields.py"/>
        <source>allowed {range}</source>
        <translation>允许 {range}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Stopped. Frames and what was learnt are kept: Train goes on from there</source>
        <translation>已停止。各帧和已学内容均保留：“训练”从此处继续</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>The robot does not move</source>
        <translation>机器人没有移动</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>No robot is seen in the vessel: push it in</source>
        <translation>血管中未见机器人：请将其推入</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Frame {count} taken: a new place</source>
        <translation>已取第 {count} 帧：新位置</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Frame {count} taken: a new bend</source>
        <translation>已取第 {count} 帧：新弯曲</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Enough frames</source>
        <translation>帧已足够</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Not taken: {why}</source>
        <translation>未取：{why}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>reading what was taken before</source>
        <translation>正在读取之前取得的内容</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>removing what was taken</source>
        <translation>正在移除取得的内容</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>one moment</source>
        <translation>请稍候</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>looking for the vessel</source>
        <translation>正在寻找血管</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>keeping the vessel</source>
        <translation>正在保存血管</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>{what}: {done} of {count}</source>
        <translation>{what}：第 {done} 项，共 {count} 项</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>taking pictures, keep still</source>
        <translation>正在拍摄，请保持不动</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>taking a picture</source>
        <translation>正在拍摄一张图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Writing the frames</source>
        <translation>正在写入各帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>writing the frames</source>
        <translation>正在写入各帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Seen already: go on to the orange branch</source>
        <translation>此处已看过：请前往橙色分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Seen already: move on, or bend the head</source>
        <translation>已见过：请继续移动，或弯曲头端</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Not started: {why}</source>
        <translation>未开始：{why}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Loading the network and frames of the twin</source>
        <translation>正在载入网络和数字孪生的帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>it was ended by signal {number}</source>
        <translation>被信号 {number} 终止</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>comparing the pictures</source>
        <translation>正在比较图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>looking at the pictures</source>
        <translation>正在查看图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>The picture is not live: check the camera, or start the rig again (F5 in the operator window)</source>
        <translation>图像不是实时的：请检查相机，或重新启动装置（操作窗口中按 F5）</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Stopping; what was learnt is kept</source>
        <translation>正在停止；已学内容保留</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Training failed: {why}</source>
        <translation>训练失败：{why}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Learns the bench</source>
        <translation>正在学习台架</translation>
    </message>
    <message>
        <location filename="../../app/teaching/model.py"/>
        <source>Has learnt; is judged on the frames that are held out</source>
        <translation>已学完；正用留出的帧评判</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>a click adds what lies around it, a right click takes it away.</source>
        <translation>单击添加周围部分，右键单击去除。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>drag along the middle of a branch, the circle as wide as it; the wheel sets the width.</source>
        <translation>沿分支中线拖动，圆与其同宽；滚轮调宽度。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>drag paints, right drag takes away.</source>
        <translation>拖动绘制，右键拖动去除。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the upper left</source>
        <translation>左上方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the top</source>
        <translation>上方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the upper right</source>
        <translation>右上方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the left branch</source>
        <translation>左侧的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch in the middle</source>
        <translation>中间的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the right branch</source>
        <translation>右侧的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the lower left</source>
        <translation>左下方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the bottom</source>
        <translation>下方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>the branch at the lower right</source>
        <translation>右下方的分支</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Empty bench</source>
        <translation>空台架</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Draw the robot back until none of it is in the picture: by hand, or hold Down with the servos on (F3); at the end of its way let go, and hold it again. Take your hands out of the picture. From here on camera and phantom stay where they are.</source>
        <translation>将机器人退回，直到图像中完全看不到它：用手，或在舵机开启时 (F3) 按住 Down 键；到行程终点时松开，再次按住。请将双手移出画面。从此刻起相机和体模不要移动。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Vessel</source>
        <translation>血管</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Blue is the vessel as the model sees it in the empty picture. Correct it once; errors of a pixel or two do no harm. The tube's wall does not belong to it.</source>
        <translation>蓝色是模型在空台架图像中看到的血管。请修正一次；一两个像素的误差无妨。管壁不属于血管。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Move the robot slowly through all branches, and bend its head both ways at some places; by hand, or with the arrow keys once the servos are on (F3). Frames are taken by themselves, and the map fills where it has been.</source>
        <translation>让机器人缓慢走过所有分支,并在几处把头部向两侧弯曲;用手,或在舵机通电后(F3)用方向键。图像会自动采集,走过的地方会在图上填满。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Missing: {what}</source>
        <translation>缺少：{what}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Look through</source>
        <translation>检查</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Orange must be the robot, all of it and nothing else. Leave out what is wrong, or correct it at the right.</source>
        <translation>橙色必须是整个机器人，且只是机器人。排除错误的帧，或在右侧修正。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Train</source>
        <translation>训练</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>It trains beside the window, which may be closed meanwhile. The present model stays, and can be chosen again.</source>
        <translation>训练在窗口之外进行，窗口可以关闭。当前模型保留，可再次选择。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Live</source>
        <translation>实时</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>The robot cannot be taken out? Lay it in {count} different places and take each: the empty bench is computed.</source>
        <translation>机器人无法取出？请把它放在 {count} 个不同位置并逐一拍摄：空台架由此计算。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Take &amp;place {number} of {count}</source>
        <translation>取位置 {number} / {count}(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Good: the empty bench is known.</source>
        <translation>很好：空台架已知。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>The model's proposal instead of what was drawn; Undo brings that back</source>
        <translation>用模型的提议代替所绘内容；“撤销”可恢复</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{done} of {count}</source>
        <translation>{done} / {count}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Nothing is missing. Next shows the frames; more may be taken.</source>
        <translation>没有缺少。“下一步”显示各帧；还可以继续取。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>left out</source>
        <translation>已排除</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>rejected</source>
        <translation>拒绝</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>place</source>
        <translation>位置</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>bend</source>
        <translation>弯曲</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{count} of {all} frames are learnt from; a quarter of them is held out, to judge by.</source>
        <translation>{all} 帧中有 {count} 帧用于学习；其中四分之一留出，用于评判。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Take picture</source>
        <translation>拍摄(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Takes eight pictures within a second</source>
        <translation>一秒内拍摄八张图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Take &amp;place</source>
        <translation>取位置(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>One picture with the robot in another place</source>
        <translation>机器人在另一位置时的一张图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>not taken yet</source>
        <translation>尚未拍摄</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>The empty picture that was taken</source>
        <translation>已拍摄的空台架图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>The present model sees a robot near ({x:.0f}, {y:.0f}), outlined above. If it is one, draw it back and take the picture again; if not, go on.</source>
        <translation>当前模型在 ({x:.0f}, {y:.0f}) 附近看到机器人，已在上方勾出。如果确是机器人，请将其退回并重新拍摄；如果不是，请继续。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{share:.1f} % of the picture are not known (dark): there the robot lay in all pictures.</source>
        <translation>图像的 {share:.1f} % 未知（深色）：所有图像中机器人都在那里。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Propose &amp;again</source>
        <translation>重新提议(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>What became of the newest picture</source>
        <translation>最新图像的处理结果</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Pause</source>
        <translation>暂停(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Take no frames for a while</source>
        <translation>暂时不取帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Waiting for the robot to move</source>
        <translation>正在等待机器人移动</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source> (Back leads to the empty picture; the frames stay)</source>
        <translation>（“上一步”可回到空台架图像；各帧保留）</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>a bend of the head</source>
        <translation>一次头端弯曲</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{count} more frames</source>
        <translation>还需 {count} 帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Frames</source>
        <translation>帧</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Leave out</source>
        <translation>排除(&amp;L)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>A double click does it, too</source>
        <translation>双击也可以</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Name of the new model</source>
        <translation>新模型的名称</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source> min</source>
        <translation> 分钟</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Time for the training</source>
        <translation>训练时间</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Train</source>
        <translation>训练(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Stop</source>
        <translation>停止(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Frames and what was learnt are kept</source>
        <translation>各帧和已学内容均保留</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Training</source>
        <translation>训练</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{what}, about {minutes:.0f} min left</source>
        <translation>{what}，约剩 {minutes:.0f} 分钟</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Model {name} is there.{more}</source>
        <translation>模型 {name} 已就绪。{more}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Take one more &amp;place</source>
        <translation>再取一个位置(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Take it again</source>
        <translation>重新拍摄(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{count} places taken</source>
        <translation>已取 {count} 个位置</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>The model sees no vessel here: drag a tube along the middle of each branch.</source>
        <translation>模型在此没有看到血管：请沿每个分支的中线拖出一根管。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Bends</source>
        <translation>弯曲</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Paused</source>
        <translation>已暂停</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>New model</source>
        <translation>新模型</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>for</source>
        <translation>训练</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source> It is in use.</source>
        <translation>正在使用。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source> Use it puts it into force, with this bench.</source>
        <translation>“使用”使其与此台架一起生效。</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>answered</source>
        <translation>已回答</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{answered} of {count} held-out frames</source>
        <translation>{count} 个留出帧中的 {answered} 个</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>right</source>
        <translation>右</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{right} of these</source>
        <translation>其中 {right} 个</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>time</source>
        <translation>时间</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>{minutes:.1f} min</source>
        <translation>{minutes:.1f} 分钟</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>What to expect on this bench</source>
        <translation>此台架上的预期结果</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>&amp;Take in again</source>
        <translation>重新纳入(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>Rejected: {why}</source>
        <translation>被拒绝：{why}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>robot (Dice)</source>
        <translation>机器人 (Dice)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/pages.py"/>
        <source>head</source>
        <translation>头端</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Teach this bench: {name}</source>
        <translation>学习此台架：{name}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>No live picture</source>
        <translation>没有实时图像</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Forget what was taken of this bench</source>
        <translation>删除为此台架取得的内容</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>What was taken is kept; the menu Model opens it again</source>
        <translation>取得的内容已保留；可从“模型”菜单再次打开</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Forget pictures, vessel and frames of this bench?</source>
        <translation>删除此台架的图像、血管和各帧？</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Forget</source>
        <translation>删除</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Not used: {why}</source>
        <translation>未使用：{why}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>&amp;Use it</source>
        <translation>使用(&amp;U)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>&amp;Close, go on training</source>
        <translation>关闭并继续训练(&amp;C)</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>Live: {who}{key}</source>
        <translation>实时：{who}{key}</translation>
    </message>
    <message>
        <location filename="../../app/teaching/window.py"/>
        <source>No live picture of this bench: choose it in the menu Rig or Twin, or start the rig (F5 in the operator window)</source>
        <translation>没有此台架的实时图像：请在“装置”或“数字孪生”菜单中选择它，或启动装置（操作窗口中按 F5）</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Step {step} of {steps}{left}. Loss {loss:.3f}, Dice vessel {vessel:.2f}, robot {robot:.2f}. {line}</source>
        <translation>第 {step} / {steps} 步{left}。损失 {loss:.3f}，Dice 血管 {vessel:.2f}，机器人 {robot:.2f}。{line}</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Letters, digits, - and _; the Model menu lists it under this name</source>
        <translation>字母、数字、- 和 _；“模型”菜单以此名列出</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>What this model can do is kept as far as possible, and the new look is learnt on top</source>
        <translation>尽量保留该模型已有的能力，并在此基础上学习新的外观</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>More steps learn more and take longer: on two processor cores a step takes about a second</source>
        <translation>步数越多学得越多，也越久：两个处理器核心上每步约一秒</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>The masks become two sets: one to learn from, and a fifth of the pictures that stays out and shows whether it helped. It runs at low priority, and the new model is used only when you choose it.</source>
        <translation>掩膜分为两组：一组用于学习，五分之一的图像留出，用来显示是否有帮助。训练以低优先级运行，新模型只有在您选择后才会使用。</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>, {duration} left</source>
        <translation>，剩余 {duration}</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Left: the loss, which training makes small. Right: Dice, the agreement of what is found with what was drawn by hand, 1 at best. What counts are the held-out pictures: when they get no better any more, it has learnt enough.</source>
        <translation>左：损失，训练使其变小。右：Dice，即检出与手绘的一致程度，最好为 1。以留出图像为准：不再变好时，就学够了。</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Before</source>
        <translation>之前</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>shown when the training has begun</source>
        <translation>训练开始后显示</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>After</source>
        <translation>之后</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>shown when it has learnt</source>
        <translation>学完后显示</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>&amp;Next picture</source>
        <translation>下一张(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>colour: found ({vessel}, {robot})</source>
        <translation>彩色：检出（{vessel}、{robot}）</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Held-out picture {place} of {count}; {found}, line: drawn by hand</source>
        <translation>留出图像 {place} / {count}；{found}，线：手绘</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Held-out picture {place} of {count}; {found}, line: the difference</source>
        <translation>留出图像 {place} / {count}；{found}，线：差异</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Train on my annotations</source>
        <translation>用我的标注训练</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Masks from {source}</source>
        <translation>掩膜来自 {source}</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source> steps</source>
        <translation> 步</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>{minutes:.0f} min</source>
        <translation>{minutes:.0f} 分钟</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Loss and Dice of the training, by step</source>
        <translation>训练的损失和 Dice，按步数</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>loss</source>
        <translation>损失</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>step</source>
        <translation>步</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>vessel</source>
        <translation>血管</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>robot</source>
        <translation>机器人</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Held-out pictures</source>
        <translation>留出图像</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>&amp;Stop, keep what was learnt</source>
        <translation>停止并保留所学(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>starts from</source>
        <translation>起始于</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Model to start from</source>
        <translation>起始模型</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>Steps of training</source>
        <translation>训练步数</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>&amp;Hide, go on training</source>
        <translation>隐藏并继续训练(&amp;H)</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>{name}, learning</source>
        <translation>{name}，学习</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>{name}, held out</source>
        <translation>{name}，留出</translation>
    </message>
    <message>
        <location filename="../../app/training/dialog.py"/>
        <source>{name} (own)</source>
        <translation>{name}（自有）</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>a name is letters, digits, - and _, 40 at most</source>
        <translation>名称只能含字母、数字、- 和 _，最多 40 个</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>there is a model {name} already; choose another name</source>
        <translation>已有模型 {name}；请换一个名称</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>{learning} pictures to learn from, {held_out} held out to judge by</source>
        <translation>{learning} 张图像用于学习，{held_out} 张留出用于评判</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Model {name} is installed{early}. Dice on held-out pictures: {vessel}, {robot}. {verdict}</source>
        <translation>模型 {name} 已安装{early}。留出图像上的 Dice：{vessel}，{robot}。{verdict}</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>{count} pictures have both masks.</source>
        <translation>{count} 张图片两种掩膜都有。</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Stopping; what was learnt is kept, which takes some seconds</source>
        <translation>正在停止；所学内容会保留，需要几秒</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>; {count} pictures left out: a mask or the picture itself is missing</source>
        <translation>；略去 {count} 张图片：缺少掩膜或图片本身</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source> after {done} of {steps} steps</source>
        <translation>（{steps} 步中完成 {done} 步）</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Model {name} is installed{early}; choose it in the Model menu</source>
        <translation>模型 {name} 已安装{early}；请在“模型”菜单中选择</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Collecting the masks</source>
        <translation>正在收集掩膜</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>vessel {before:.2f} → {after:.2f}</source>
        <translation>血管 {before:.2f} → {after:.2f}</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>robot {before:.2f} → {after:.2f}</source>
        <translation>机器人 {before:.2f} → {after:.2f}</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Stopped before the first step; there is no new model</source>
        <translation>在第一步之前已停止；没有新模型</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>It is WORSE than before on the held-out pictures</source>
        <translation>在留出图像上比以前更差</translation>
    </message>
    <message>
        <location filename="../../app/training/model.py"/>
        <source>Choose it in the Model menu</source>
        <translation>请在“模型”菜单中选择</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>The language changes at the next start of the program</source>
        <translation>语言将在下次启动程序后更改</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>About LumenPilot</source>
        <translation>关于 LumenPilot</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>Teleoperation assist for a tendon-driven interventional robot: it finds vessel and robot in the picture, tells how the robot's head lies against the vessel's centerline, advises, and on request drives.

For research benches. It is not a medical device; STOP is a stop, not an emergency stop.

MIT licence. Typeface: Inter, SIL Open Font Licence.</source>
        <translation>面向腱驱动介入机器人的遥操作辅助：在图像中找出血管和机器人，说明机器人头端相对血管中心线的位姿，给出建议，并可按要求自主驾驶。

供科研台架使用，不是医疗器械；“停止”只是停止，不是急停。

MIT 许可证。字体：Inter，SIL 开放字体许可证。</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>&amp;Help</source>
        <translation>帮助(&amp;H)</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>&amp;About LumenPilot</source>
        <translation>关于 LumenPilot(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>&amp;Keys</source>
        <translation>按键(&amp;K)</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>As the &amp;system says</source>
        <translation>跟随系统(&amp;S)</translation>
    </message>
    <message>
        <location filename="../../app/ui/actions.py"/>
        <source>&amp;Language (中文)</source>
        <translation>语言(&amp;L) (Language)</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Operator</source>
        <translation>操作者</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>who recorded it</source>
        <translation>由谁录制</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Task</source>
        <translation>任务</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>what was done</source>
        <translation>做了什么</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Condition</source>
        <translation>条件</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>such as the arm of a study</source>
        <translation>例如研究的分组</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Phantom</source>
        <translation>体模</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>what lay before the camera</source>
        <translation>相机前面是什么</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Tags</source>
        <translation>标签</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>separated by commas</source>
        <translation>以逗号分隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Description</source>
        <translation>描述</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Keep</source>
        <translation>保留</translation>
    </message>
    <message>
        <location filename="../../app/ui/description_form.py"/>
        <source>Notes</source>
        <translation>备注</translation>
    </message>
    <message>
        <location filename="../../app/ui/layout_state.py"/>
        <source>&amp;View</source>
        <translation>视图(&amp;V)</translation>
    </message>
    <message>
        <location filename="../../app/ui/layout_state.py"/>
        <source>&amp;Reset layout</source>
        <translation>重置布局(&amp;R)</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Opening the player: {name}</source>
        <translation>正在打开回放器：{name}</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Opening the annotator: {name}</source>
        <translation>正在打开标注窗口：{name}</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Opening the library</source>
        <translation>正在打开会话库</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>, {left:.0f} s left</source>
        <translation>，剩余 {left:.0f} 秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Stop it</source>
        <translation>停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>{done:.0f} of {total:.0f} {what}{left}</source>
        <translation>{done:.0f} / {total:.0f} {what}{left}</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Cancelled</source>
        <translation>已取消</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>That window ended with exit code {code}</source>
        <translation>该窗口以退出码 {code} 结束</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Ended with exit code {code}</source>
        <translation>以退出码 {code} 结束</translation>
    </message>
    <message>
        <location filename="../../app/ui/opening.py"/>
        <source>Nothing was opened yet</source>
        <translation>尚未打开任何文件</translation>
    </message>
    <message>
        <location filename="../../app/ui/snapshot.py"/>
        <source>Snapshot saved: {path} (with _overlay.png and .json)</source>
        <translation>截图已保存：{path}（及 _overlay.png 和 .json）</translation>
    </message>
    <message>
        <location filename="../../app/ui/snapshot.py"/>
        <source>Snapshot not saved: {why}</source>
        <translation>截图未保存：{why}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The way ahead may ask for something else: then badge and advice say so, and the advice counts.</source>
        <translation>前方路线可能要求不同的动作：此时徽标和建议会说明，以建议为准。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>press {key} to arm; then you can hand over to the program</source>
        <translation>按 {key} 进入待命；之后可移交给程序</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>hold {deadman}, then press {key} to hand over</source>
        <translation>按住 {deadman}，再按 {key} 移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>hold {deadman} and press {again} to go on, or {back} to take back</source>
        <translation>按住 {deadman} 再按 {again} 继续，或按 {back} 收回控制</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>On the centerline</source>
        <translation>在中心线上</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Coming back</source>
        <translation>正在返回</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Moving away</source>
        <translation>正在偏离</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Crossed</source>
        <translation>已越过</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>A: on the centerline and along it. Ideal: speed up, no steering.</source>
        <translation>A：在中心线上且方向一致。理想：加速，不转向。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>B: the head is nearer to the centerline than the tail. Coming back: slow down, no steering.</source>
        <translation>B：头端比尾端更靠近中心线。正在返回：减速，不转向。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>C: the head is farther from the centerline than the tail. Moving away: slowest, steer hardest.</source>
        <translation>C：头端比尾端更远离中心线。正在偏离：最慢，转向最大。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>D: head and tail lie on opposite sides of the centerline. Crossed: moderate speed, steer by theta.</source>
        <translation>D：头端和尾端位于中心线两侧。已越过：中速，按 θ 转向。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Slowest</source>
        <translation>极慢</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Slow</source>
        <translation>慢速</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Moderate</source>
        <translation>中速</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Fast</source>
        <translation>快速</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{how}, {angle:.0f}° {side}</source>
        <translation>{how}，{side} {angle:.0f}°</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{camera}, {servos}; {calibrated}; made {made:%Y-%m-%d}</source>
        <translation>{camera}，{servos}；{calibrated}；制作于 {made:%Y-%m-%d}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The gear's friction may take it all: larger drums, or max_force_n of at least {forces}</source>
        <translation>减速器的摩擦可能抵消全部力:请换更大的卷筒,或把 max_force_n 设为至少 {forces}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>lens</source>
        <translation>镜头</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>scale</source>
        <translation>比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>steering</source>
        <translation>转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>zero</source>
        <translation>零位</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Servos on</source>
        <translation>开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Check all servos and switch their torque on: then you can move the robot by hand</source>
        <translation>检查所有舵机并接通力矩：然后可以手动移动机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Acknowledge</source>
        <translation>确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>I have read why the program stopped; nothing moves by this</source>
        <translation>我已了解程序停止的原因；此操作不会引起运动</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Arm</source>
        <translation>进入待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Allow the program to be handed over to; nothing moves by this</source>
        <translation>允许把控制移交给程序；此操作不会引起运动</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Hand over</source>
        <translation>移交控制</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The program drives to the target for as long as the deadman is held</source>
        <translation>按住使能键期间，程序驾驶到目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Take back</source>
        <translation>收回控制</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>You steer again, at once; moving the controls does the same</source>
        <translation>立即重新由您操纵；动一下操纵键也一样</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Disarm</source>
        <translation>解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The program may not be handed over to any more; you go on steering by hand</source>
        <translation>不再允许移交给程序；您继续手动操纵</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>pictures only</source>
        <translation>仅图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>pictures and advice only</source>
        <translation>只有图像和建议</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>waiting for the rig</source>
        <translation>正在等待台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Waiting for the rig</source>
        <translation>等待装置</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>no rig is open</source>
        <translation>没有打开的装置</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>No rig is open</source>
        <translation>没有打开的装置</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>F5 opens it again</source>
        <translation>按 F5 重新打开</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>interrupted</source>
        <translation>已中断</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>nothing moves</source>
        <translation>无运动</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>the program drives</source>
        <translation>程序驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>you steer</source>
        <translation>您操纵</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>servos not in use</source>
        <translation>舵机未使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>let go and it holds; move the controls or press {key} to steer yourself</source>
        <translation>松开即保持；动操纵键或按 {key} 由您操纵</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>press {key}: they are checked with the torque off, then tighten the wires</source>
        <translation>按 {key}：先在无力矩下检查，然后张紧驱动丝</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{sentence}.</source>
        <translation>{sentence}。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>press {key}, then switch the servos on</source>
        <translation>按 {key}，然后开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>press {key}: the program drives while you hold</source>
        <translation>按 {key}：按住期间由程序驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Ready</source>
        <translation>就绪</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Interrupted</source>
        <translation>已中断</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>the pedal</source>
        <translation>脚踏</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>fast, no steering</source>
        <translation>快速，不转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>slow, no steering</source>
        <translation>慢速，不转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>slowest, steer</source>
        <translation>最慢，转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>moderate, steer</source>
        <translation>中速，转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>the route decides, not state {state}</source>
        <translation>由路线决定，而非状态 {state}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Image unreadable</source>
        <translation>图像无法读取</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>check the camera or the file</source>
        <translation>检查相机或文件</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>No model</source>
        <translation>没有模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>put back resources/models/default, or choose another model in the configuration</source>
        <translation>恢复 resources/models/default，或在配置中选择另一个模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Image is black</source>
        <translation>图像全黑</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>take off the lens cap, switch the lamp on or raise the exposure</source>
        <translation>取下镜头盖、打开灯或提高曝光</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Image is overexposed</source>
        <translation>图像过曝</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>dim the lamp or lower the exposure</source>
        <translation>调暗灯光或降低曝光</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Image is blurred</source>
        <translation>图像模糊</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>focus the camera or hold it still</source>
        <translation>给相机对焦或使其保持不动</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>No vessel in view</source>
        <translation>视野中没有血管</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>point the camera at the phantom</source>
        <translation>把相机对准体模</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>No robot in view</source>
        <translation>视野中没有机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>advance the robot into the picture</source>
        <translation>把机器人推进到图像中</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Several robots in view</source>
        <translation>视野中有多个机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>leave one robot in the picture</source>
        <translation>图像中只留一个机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Too little of the robot in view</source>
        <translation>视野中的机器人太短</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>advance it a little</source>
        <translation>再推进一点</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Robot is outside the vessel</source>
        <translation>机器人在血管之外</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>check the phantom, or clear what looks like a robot</source>
        <translation>检查体模，或移开像机器人的物体</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Too much of the robot is hidden</source>
        <translation>机器人被遮挡过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>remove what covers it</source>
        <translation>移开遮挡物</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The robot's path is not clear</source>
        <translation>机器人的路径不明确</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>retract a little so that it does not cross itself</source>
        <translation>后退一点，使其不与自身交叉</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Two branches fit</source>
        <translation>两条分支都符合</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>click the target in the picture</source>
        <translation>在图像中单击目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Not sure enough to answer</source>
        <translation>把握不足，不给结果</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>better light or focus helps</source>
        <translation>改善光照或对焦会有帮助</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Picture of an unknown kind</source>
        <translation>未知类型的图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>teach this bench (menu Model)</source>
        <translation>学习此台架（“模型”菜单）</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The head jumped</source>
        <translation>头端位置跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>wait for the next frames</source>
        <translation>等待接下来的几帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The camera or the phantom was moved</source>
        <translation>相机或体模被移动</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>put it back, or make the bench again</source>
        <translation>放回原位，或重新建立台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Not the bench that was set up</source>
        <translation>不是所设置的台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>point the camera at the phantom, or make the bench again</source>
        <translation>把相机对准体模，或重新建立台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>left</source>
        <translation>左</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>allowed {limit:g}</source>
        <translation>允许 {limit:g}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{line} (kept for a moment)</source>
        <translation>{line}（暂时保持）</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Back off, {speed}</source>
        <translation>后退，{speed}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{how}, straight</source>
        <translation>{how}，直行</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{length:.0f} px to go</source>
        <translation>剩余 {length:.0f} px</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>no way: {why}</source>
        <translation>无路可达：{why}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>distance unknown without a pose</source>
        <translation>没有位姿，距离未知</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Angle between the line through the robot's last 40 px and the line through 40 px of the vessel's centerline beside the head. Positive: the robot points to the right of the vessel's direction, as seen on screen.</source>
        <translation>机器人末段 40 px 的拟合线与头端旁 40 px 血管中心线的拟合线之间的夹角。正值：在屏幕上机器人指向血管方向的右侧。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>working px</source>
        <translation>工作像素</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Distance of the robot's head from the vessel's line. Working pixels: the picture scaled to 640 px along its longer side.</source>
        <translation>机器人头端到血管线的距离。工作像素：图像长边缩放到 640 px。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Distance of the point 40 px behind the head from the same line. On the other side than the head: the robot has crossed.</source>
        <translation>头端后方 40 px 处的点到同一条线的距离。与头端不在同一侧时：机器人已越过。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Head and tail of the robot's line lie on opposite sides of the vessel's line: one of them is past it.</source>
        <translation>机器人线的头端和尾端位于血管线两侧：其中一端已越过。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Pose state</source>
        <translation>位姿状态</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>0 to 1</source>
        <translation>0 至 1</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Chance that the answer is right (theta within 5 degrees, head within 15 px), as learnt on pictures with known truth. Where it is low, the answer is shown as unsure, and its shape is not filled; where it is lower, there is a reason instead.</source>
        <translation>结果正确的概率（θ 误差 5 度内，头端 15 px 内），由已知真值的图像学得。偏低时结果显示为“不确定”，其形状不填充；更低时不给结果，只给原因。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Room</source>
        <translation>余量</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>working px, about mm</source>
        <translation>工作像素，约 mm</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Between the edge of the robot's head and the wall of the vessel. The bar is full on the centerline and empty at the wall.</source>
        <translation>机器人头端边缘到血管壁之间的距离。在中心线上时条形为满，贴壁时为空。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Wall force</source>
        <translation>管壁受力</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Sum of the contact forces of the robot on the vessel's wall. Known on the bench twin only.</source>
        <translation>机器人对血管壁的接触力之和。只有数字孪生台架能给出。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The vessel phantom that the bench twin shows; another one starts the twin again.</source>
        <translation>数字孪生台架显示的血管体模；选择另一个会重新启动。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Seed</source>
        <translation>种子</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Of the random phantom: the same seed gives the same phantom.</source>
        <translation>随机体模的种子：相同的种子得到相同的体模。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Advice</source>
        <translation>建议</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>mm/s and degrees</source>
        <translation>mm/s 和度</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>How fast to advance or retract, and how far to turn the head (right and left as seen on screen). Unless you hand over, you steer, and nothing is sent to the robot but what you ask for.</source>
        <translation>前进或后退的快慢，以及头端转多少（左右以屏幕为准）。除非您移交控制，否则由您操纵，机器人只收到您要求的动作。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Four things kept apart: advised, asked by you, commanded by the program, and sent after the gate. Bend and pitch: share of the tendons' full pull; advised: the turn in degrees. ≠: the gate sent something else than was asked.</source>
        <translation>四者分开显示：建议、您的要求、程序的指令、经安全闸后实际发送的。弯曲和俯仰：占驱动丝最大牵拉的比例；建议：转角的度数。≠：安全闸实际发送的与要求不同。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Capture to servo</source>
        <translation>采集到舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>From the picture to the command made of it. It should stay below 100 ms.</source>
        <translation>从图像到由它产生的指令所用时间。应低于 100 ms。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Following</source>
        <translation>跟随度</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>How far your motions of the last ten seconds agreed with the advice.</source>
        <translation>最近十秒内您的动作与建议的一致程度。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>share of full pull</source>
        <translation>占最大牵拉的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>How far the head is bent, as the tendons are pulled: left and right of the middle.</source>
        <translation>按驱动丝的牵拉，头端弯曲了多少：中间为零，左右两侧。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>pitch</source>
        <translation>俯仰</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>How far the head is bent out of the picture's plane: right is lifted.</source>
        <translation>头端弯出图像平面的程度：右侧为上仰。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Speeds by hand</source>
        <translation>手动速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>What a key makes while it is held, at the chosen share of full speed: way of the feed, of the sheath, and pull of the tendons' wires. A press of a tenth of a second makes about a tenth of that way.</source>
        <translation>按住一个键时的运动速度（按所选的全速比例）：推送、鞘管的行程，以及驱动丝的收放。按十分之一秒，行程约为其十分之一。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>in</source>
        <translation>进深</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>How far the robot is in, by the feed's servo.</source>
        <translation>按推送舵机计算，机器人已进入多少。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Deadman</source>
        <translation>使能键</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The program drives only while you hold this with the mouse, hold {deadman} or stand on the pedal. Let go and the robot holds. It must be pressed after arming: what was down before does not count.</source>
        <translation>只有用鼠标按住此处、按住 {deadman} 或踩住脚踏板时，程序才会驾驶。松开机器人即保持。必须在待命之后按下：之前已按下的不算。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Tendon pair</source>
        <translation>驱动丝对</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>mm and N</source>
        <translation>mm 和 N</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Two wires that pull against each other: the sum of their pulls should be twice the pretension. Bar to the left: slack. Bar to the right: too tight. In N: tension of either wire as the motor's current tells it, friction included.</source>
        <translation>相互拮抗的两根驱动丝：牵拉之和应为预紧量的两倍。条形偏左：松弛；偏右：过紧。以 N 表示时：由电机电流得到的每根丝的张力，含摩擦。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>shown/s</source>
        <translation>显示/秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Frames drawn on this screen per second.</source>
        <translation>本屏幕每秒绘制的帧数。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>frames/s</source>
        <translation>帧/秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Frames perceived per second.</source>
        <translation>每秒感知的帧数。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>frames</source>
        <translation>帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The camera gave them, but nobody looked: a newer one was there already.</source>
        <translation>相机给出但未处理：因为已有更新的一帧。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>block</source>
        <translation>阻塞</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Longest time in the last 10 s in which this window could not react to you.</source>
        <translation>最近 10 秒内此窗口最长多久无法响应您。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Latency</source>
        <translation>延迟</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Time that each stage took for one frame, over the last seconds: half of the frames were quicker than p50, 95 % were quicker than p95.</source>
        <translation>最近几秒内每个阶段处理一帧所用时间：一半的帧快于 p50，95 % 快于 p95。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>degrees, px</source>
        <translation>度，px</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Theta above, d_head and d_tail (dotted) below, and the state as a band. Gaps: no pose.</source>
        <translation>上为 θ，下为 d_head 和 d_tail（点线），状态显示为色带。断开处：无位姿。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The whole session: states as a band, theta, gaps, and marks of alerts, steps, targets and notes. Click or drag goes there, the wheel zooms, Shift and drag selects.</source>
        <translation>整个会话：状态色带、θ、缺口，以及警报、操作、目标点和备注的标记。单击或拖动跳到该处，滚轮缩放，Shift 加拖动选择。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Length of robot and vessel that the two lines are fitted to: less than 40 + 40 is less sure.</source>
        <translation>拟合两条线所用的机器人和血管长度：少于 40 + 40 时不太可靠。</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>bench twin</source>
        <translation>数字孪生台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>webcam {device}</source>
        <translation>网络摄像头 {device}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>its own servos</source>
        <translation>自带舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>servos on {port}</source>
        <translation>舵机在 {port}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>no servos</source>
        <translation>无舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>scale: {scale:.4f} mm/px in the middle, ±{share:.2f} % (by {method})</source>
        <translation>比例：中间 {scale:.4f} mm/px，±{share:.2f} %（{method}）</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>servos (direction and id): {servos}</source>
        <translation>舵机（方向与 id）：{servos}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The program drives</source>
        <translation>程序正在驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>this takes a moment</source>
        <translation>请稍候</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>The servos are not in use, but may still pull</source>
        <translation>舵机未使用，但可能仍在拉紧</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>Stopped</source>
        <translation>已停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>head {head:.0f} px {side}, tail {tail:.0f} px {other_side} of the centerline, {angle}</source>
        <translation>头端在中心线{side}侧 {head:.0f} px，尾端在{other_side}侧 {tail:.0f} px，{angle}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>{advice}. {detail}</source>
        <translation>{advice}。{detail}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>not calibrated</source>
        <translation>未标定</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>lens: k1 {k1:+.4f}, k2 {k2:+.4f}, {left:.2f} px left over</source>
        <translation>镜头：k1 {k1:+.4f}，k2 {k2:+.4f}，残差 {left:.2f} px</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>way at one turn of the horn, by the diameters measured: {ways} mm</source>
        <translation>舵盘每转的行程，按所测直径：{ways} mm</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>way at one turn of the horn, as it is set and not measured: {ways} mm</source>
        <translation>舵机输出盘每转一圈的行程（按设置，未测量）：{ways} mm</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>greatest force, limited in the servo, friction included: {forces} N</source>
        <translation>最大力，在舵机内限制，含摩擦：{forces} N</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>this drive cannot limit its force</source>
        <translation>此驱动器无法限制其力</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>assumed: {joints} by the order of their ids, since one camera cannot tell them apart; look at the head, and swap them in the rig wizard if it goes the other way</source>
        <translation>按 id 的顺序假定：{joints}，因为一台相机分不清；请观察头端，若方向相反，在装置向导中交换</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>assumed: the direction of the rotation, which one camera cannot see; confirm it in the rig wizard</source>
        <translation>假定：旋转方向，一台相机看不出；请在装置向导中确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>steering, 0° to the right and 90° down in the picture: {ways}; roll {roll:+.0f}°</source>
        <translation>转向，图像中 0° 向右、90° 向下：{ways}；滚转 {roll:+.0f}°</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>zero: wires were slack by {slack} mm; pretension {pretension:g} mm</source>
        <translation>零位：驱动丝原松弛 {slack} mm；预紧 {pretension:g} mm</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>allowed {limit:g}°</source>
        <translation>允许 {limit:g}°</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>to the centerline: {compared}, {angle}</source>
        <translation>趋向中心线：{compared}，{angle}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>from the centerline: {compared}, {angle}</source>
        <translation>偏离中心线：{compared}，{angle}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>calibrated: {parts}</source>
        <translation>已标定：{parts}</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source>turn of the head: {turn:.0f}° per mm of pull</source>
        <translation>头端转角：每毫米拉线 {turn:.0f}°</translation>
    </message>
    <message>
        <location filename="../../app/ui/texts.py"/>
        <source> and </source>
        <translation> 和 </translation>
    </message>
    <message>
        <location filename="../../app/ui/window_base.py"/>
        <source>F1  keys</source>
        <translation>F1  按键</translation>
    </message>
    <message>
        <location filename="../../app/ui/window_base.py"/>
        <source>&amp;Full screen</source>
        <translation>全屏(&amp;F)</translation>
    </message>
    <message>
        <location filename="../../app/ui/window_base.py"/>
        <source>&amp;Quit</source>
        <translation>退出(&amp;Q)</translation>
    </message>
    <message>
        <location filename="../../app/ui/window_base.py"/>
        <source>Open recent</source>
        <translation>打开最近的文件</translation>
    </message>
    <message>
        <location filename="../../app/widgets/alerts.py"/>
        <source>+{count} more</source>
        <translation>另有 {count} 项</translation>
    </message>
    <message>
        <location filename="../../app/widgets/alerts.py"/>
        <source>No alerts</source>
        <translation>无警报</translation>
    </message>
    <message>
        <location filename="../../app/widgets/alerts.py"/>
        <source>Alerts: </source>
        <translation>警报：</translation>
    </message>
    <message>
        <location filename="../../app/widgets/alerts.py"/>
        <source>Click to dismiss</source>
        <translation>单击关闭</translation>
    </message>
    <message>
        <location filename="../../app/widgets/basics.py"/>
        <source>Pages</source>
        <translation>页面</translation>
    </message>
    <message>
        <location filename="../../app/widgets/basics.py"/>
        <source>Drag to give one side more room</source>
        <translation>拖动以给一侧更多空间</translation>
    </message>
    <message>
        <location filename="../../app/widgets/basics.py"/>
        <source>Border between the columns</source>
        <translation>两栏之间的分界</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>advance mm/s</source>
        <translation>前进 mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>sheath mm/s</source>
        <translation>鞘管 mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Advised</source>
        <translation>建议</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>You asked</source>
        <translation>您的要求</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Program</source>
        <translation>程序</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Sent</source>
        <translation>已发送</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>straight</source>
        <translation>直行</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Gate: {clamped} goals limited, {rejected} commands rejected</source>
        <translation>安全闸：{clamped} 个目标被限幅，{rejected} 条指令被拒绝</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>{angle:.0f}° {side}</source>
        <translation>{angle:.0f}° {side}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>capture → servo {time}</source>
        <translation>采集 → 舵机 {time}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>following the advice {share}</source>
        <translation>跟随建议 {share}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Gate: no servo bus</source>
        <translation>安全闸：没有舵机总线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Gate: nothing limited or rejected yet</source>
        <translation>安全闸：尚无限幅或拒绝</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>no advice: {why}</source>
        <translation>无建议：{why}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>no advice</source>
        <translation>无建议</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>up</source>
        <translation>上</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>down</source>
        <translation>下</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>Advice, commands and what was sent</source>
        <translation>建议、指令与实际发送</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>What it did stands in the page Log</source>
        <translation>其动作记录在“日志”页</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>does not drive</source>
        <translation>未驾驶</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>no motion: holding</source>
        <translation>无运动：保持</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>limited by the gate</source>
        <translation>被安全闸限制</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>stopped at the end of its envelope</source>
        <translation>停在行程范围的末端</translation>
    </message>
    <message>
        <location filename="../../app/widgets/command_panel.py"/>
        <source>drives: </source>
        <translation>驾驶中：</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Wall force  {number}</source>
        <translation>管壁受力  {number}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Force  {number}</source>
        <translation>受力  {number}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>not known</source>
        <translation>未知</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Distances from the centerline</source>
        <translation>到中心线的距离</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room to the wall</source>
        <translation>到管壁的余量</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>wall</source>
        <translation>管壁</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>centerline</source>
        <translation>中心线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room to the wall: {why}</source>
        <translation>到管壁的余量：{why}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room: not known</source>
        <translation>余量：未知</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>BREACH: the head is in the wall  ({both})</source>
        <translation>触壁：头端已在管壁内  ({both})</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>BREACH: in the wall  ({room})</source>
        <translation>触壁：在管壁内  ({room})</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>BREACH {room}</source>
        <translation>触壁 {room}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>BREACH</source>
        <translation>触壁</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Wall force  {number}, {word}</source>
        <translation>管壁受力  {number}，{word}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>at the wall</source>
        <translation>贴壁</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>near the wall</source>
        <translation>近壁</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room to the wall  {both}, {word}</source>
        <translation>到管壁的余量  {both}，{word}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room  {both}, {word}</source>
        <translation>余量  {both}，{word}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room to the wall  {both}</source>
        <translation>到管壁的余量  {both}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room  {both}</source>
        <translation>余量  {both}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>Room  {room}</source>
        <translation>余量  {room}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>leans on the wall</source>
        <translation>贴靠管壁</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>leans</source>
        <translation>贴靠</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>PRESSES TOO HARD</source>
        <translation>压力过大</translation>
    </message>
    <message>
        <location filename="../../app/widgets/distance_bars.py"/>
        <source>TOO HARD</source>
        <translation>过大</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Modes</source>
        <translation>模式</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Alerts</source>
        <translation>警报</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>gate</source>
        <translation>安全闸</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Gate: clamped and rejected</source>
        <translation>安全闸：限幅与拒绝</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>operator</source>
        <translation>操作者</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Targets</source>
        <translation>目标</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Kind of events shown</source>
        <translation>所显示事件的类别</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Which events are listed</source>
        <translation>列出哪些事件</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Everything</source>
        <translation>全部</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Event log</source>
        <translation>事件日志</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Copy all</source>
        <translation>全部复制</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Events, newest first</source>
        <translation>事件，最新在前</translation>
    </message>
    <message>
        <location filename="../../app/widgets/event_log.py"/>
        <source>Show</source>
        <translation>显示</translation>
    </message>
    <message>
        <location filename="../../app/widgets/image_canvas.py"/>
        <source>Contrast</source>
        <translation>对比度</translation>
    </message>
    <message>
        <location filename="../../app/widgets/image_canvas.py"/>
        <source>Brightness</source>
        <translation>亮度</translation>
    </message>
    <message>
        <location filename="../../app/widgets/image_canvas.py"/>
        <source>{name} of the picture on the screen  (keys {keys}; / resets both)</source>
        <translation>屏幕上图像的{name}  （按键 {keys}；/ 全部重置）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>speeds: feed {feed:.3g}, sheath {sheath:.3g}, tendons {wires} mm/s</source>
        <translation>速度：进给 {feed:.3g}，鞘管 {sheath:.3g}，腱 {wires} mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>speeds: feed {feed:.3g}, tendons {wires} mm/s</source>
        <translation>速度：推进 {feed:.3g}，腱绳 {wires} mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>{motion}: hold to move, release to stop; {speed:.3g} mm/s</source>
        <translation>{motion}：按住移动，松开停止；{speed:.3g} mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>{motion}: hold to move, release to stop; {speed:.3g} °/s</source>
        <translation>{motion}:按住移动,松开停止;{speed:.3g} °/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>{motion}: hold to move, release to stop; the tendons are pulled {speed:.3g} mm/s</source>
        <translation>{motion}：按住移动，松开停止；驱动丝收放 {speed:.3g} mm/s</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>steer left</source>
        <translation>向左弯</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>steer right</source>
        <translation>向右弯</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>advance</source>
        <translation>前进</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>retract</source>
        <translation>后退</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>pitch up</source>
        <translation>向上俯仰</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>pitch down</source>
        <translation>向下俯仰</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>sheath forward</source>
        <translation>鞘管前进</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>sheath back</source>
        <translation>鞘管后退</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>straighten the head</source>
        <translation>头端回直</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>turn the shaft left</source>
        <translation>向左转动轴</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>turn the shaft right</source>
        <translation>向右转动轴</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>bend {bend}, pitch {pitch}, inserted {inserted} mm</source>
        <translation>弯曲 {bend}，俯仰 {pitch}，进深 {inserted} mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>inserted {inserted} mm</source>
        <translation>进深 {inserted} mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>bring bend and pitch back to the middle: hold to move, release to stop</source>
        <translation>弯曲和俯仰回到中间：按住移动，松开停止</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>Bend, pitch and insertion</source>
        <translation>弯曲、俯仰与进深</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>Keys that move the robot</source>
        <translation>移动机器人的按键</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>Speed by hand</source>
        <translation>手动速度</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>Speed of all motions by hand, of the configured full speed</source>
        <translation>所有手动动作的速度，占所配置全速的比例</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>sheath +</source>
        <translation>鞘管 +</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>sheath −</source>
        <translation>鞘管 −</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>turn left</source>
        <translation>左转</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>turn right</source>
        <translation>右转</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>straighten</source>
        <translation>回直</translation>
    </message>
    <message>
        <location filename="../../app/widgets/jog_panel.py"/>
        <source>{motion}: hold to move, release to stop</source>
        <translation>{motion}：按住移动，松开停止</translation>
    </message>
    <message>
        <location filename="../../app/widgets/live_view.py"/>
        <source>Magnified head</source>
        <translation>头端放大图</translation>
    </message>
    <message>
        <location filename="../../app/widgets/live_view.py"/>
        <source>Live picture</source>
        <translation>实时图像</translation>
    </message>
    <message>
        <location filename="../../app/widgets/live_view.py"/>
        <source>Click sets the target, right click clears it</source>
        <translation>单击设定目标，右击清除</translation>
    </message>
    <message>
        <location filename="../../app/widgets/messages.py"/>
        <source>Start again  (F5)</source>
        <translation>重新启动  (F5)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/messages.py"/>
        <source>Close this</source>
        <translation>关闭</translation>
    </message>
    <message>
        <location filename="../../app/widgets/messages.py"/>
        <source>Close this offer</source>
        <translation>关闭此提示</translation>
    </message>
    <message>
        <location filename="../../app/widgets/messages.py"/>
        <source>Question</source>
        <translation>询问</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>you steer, the program only advises</source>
        <translation>您操纵，程序只给建议</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>you steer; the program may be handed over to</source>
        <translation>您操纵；可以移交给程序</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>the program drives while the deadman is held</source>
        <translation>按住使能键期间程序驾驶</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>the program's motion is interrupted; the robot holds</source>
        <translation>程序的运动被中断；机器人保持</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>nothing moves until the stop is acknowledged</source>
        <translation>确认停止之前不会有运动</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Stops the robot at once. Key {key}.</source>
        <translation>立即停止机器人。按键 {key}。</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Stops the robot at once, in every mode  ({key})
{key} types a space in a text field only while nothing can move; Ctrl+{key} and Pause stop there, too
It is no emergency stop: that is the power cut, by hand, beside the robot</source>
        <translation>在任何模式下立即停止机器人  ({key})
只有在没有东西会动时，{key} 才在文本框中输入空格；Ctrl+{key} 和 Pause 在那里也能停止
它不是急停：急停是机器人旁用手按的断电开关</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Deadman: hold to drive ({key})</source>
        <translation>使能键：按住驾驶 ({key})</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Hold to drive</source>
        <translation>按住驾驶</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Mode: {mode}</source>
        <translation>模式：{mode}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>Who drives</source>
        <translation>由谁驾驶</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>What is next</source>
        <translation>下一步</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>none</source>
        <translation>无</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>not held</source>
        <translation>未按住</translation>
    </message>
    <message>
        <location filename="../../app/widgets/mode_bar.py"/>
        <source>held</source>
        <translation>按住</translation>
    </message>
    <message>
        <location filename="../../app/widgets/performance_panel.py"/>
        <source>pause ms</source>
        <translation>暂停 ms</translation>
    </message>
    <message>
        <location filename="../../app/widgets/performance_panel.py"/>
        <source>ms per frame</source>
        <translation>每帧 ms</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Random …</source>
        <translation>随机…</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>New</source>
        <translation>新建</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Another random phantom (key R)</source>
        <translation>另一个随机体模（按键 R）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Another random phantom</source>
        <translation>另一个随机体模</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>random {seed}</source>
        <translation>随机 {seed}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>seed </source>
        <translation>种子 </translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Seed of the random phantom</source>
        <translation>随机体模的种子</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Ctrl+P opens the list; so does Enter when Tab has come here</source>
        <translation>Ctrl+P 打开列表；Tab 移到此处后按 Enter 也可以</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Choose a &amp;phantom</source>
        <translation>选择体模(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/phantom_picker.py"/>
        <source>Another ran&amp;dom phantom</source>
        <translation>另一个随机体模(&amp;D)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>weakest bend: {force:.2f} N</source>
        <translation>最薄弱弯道：{force:.2f} N</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>What the network took for vessel (blue) and robot (orange)</source>
        <translation>网络判为血管（蓝）和机器人（橙）的部分</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Centerline</source>
        <translation>中心线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The vessel's centerline, from its skeleton</source>
        <translation>由骨架得到的血管中心线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Robot</source>
        <translation>机器人</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The robot's path from tail to head; dotted where a gap was repaired</source>
        <translation>机器人从尾端到头端的路径；修复断点处为点线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Head</source>
        <translation>头端</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The robot's head</source>
        <translation>机器人的头端</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Vectors</source>
        <translation>向量</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Fitted lines of robot (40 px, yellow) and vessel (light blue), and theta between them</source>
        <translation>机器人（40 px，黄）和血管（浅蓝）的拟合线，及其夹角 θ</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Nearest</source>
        <translation>最近点</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The centerline point nearest to the head</source>
        <translation>中心线上离头端最近的点</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Distances</source>
        <translation>距离</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>d_head and d_tail: from the vessel line to both ends of the robot vector</source>
        <translation>d_head 和 d_tail：血管线到机器人向量两端的距离</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Route</source>
        <translation>路线</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The operator's target and the way to it</source>
        <translation>操作者的目标点及去路</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The surroundings of the head, magnified, in a corner of the picture</source>
        <translation>图像一角的头端周围放大图</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Ghost</source>
        <translation>虚影</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Where the head goes in the next two seconds if the advice is followed: the broken tube</source>
        <translation>若遵循建议，头端在接下来两秒的去处：虚线管形</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Band</source>
        <translation>范围带</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>The rehearsal: 90 % of the heads' paths lie in the band; yellow, orange, red: wall force from 0.05, 0.15, 0.5 N on</source>
        <translation>预演：90 % 的头部路径在范围带内；黄、橙、红：壁面力分别从 0.05、0.15、0.5 N 起</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>turns by {turn:.0f}°, the head by {limit:.0f}°</source>
        <translation>转角 {turn:.0f}°，头部可弯 {limit:.0f}°</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>{count} runs ended here</source>
        <translation>{count} 次运行在此结束</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Overlays</source>
        <translation>叠加层</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_overlay.py"/>
        <source>Overlay {label}</source>
        <translation>叠加层 {label}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>waiting for the first picture</source>
        <translation>等待第一幅图像</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>A: up to {limit:g}°</source>
        <translation>A：不超过 {limit:g}°</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>A: up to {limit:g} px</source>
        <translation>A：不超过 {limit:g} px</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>&amp;All overlays on or off</source>
        <translation>显示或隐藏所有叠加层(&amp;A)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>&amp;Next page</source>
        <translation>下一页(&amp;N)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>&amp;Previous page</source>
        <translation>上一页(&amp;P)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>No advice: {why}</source>
        <translation>无建议：{why}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>the pose is unsure; {why}</source>
        <translation>位姿不确定；{why}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/scene_panels.py"/>
        <source>Then: {advice}</source>
        <translation>然后：{advice}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>envelope {low_mm:g} to {high_mm:g} mm, slow within {margin:g} mm of its ends</source>
        <translation>行程范围 {low_mm:g} 至 {high_mm:g} mm，距末端 {margin:g} mm 内减速</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>cycle {half:.1f} ms, {sign}p99 {most:.1f} ms</source>
        <translation>周期 {half:.1f} ms，{sign}p99 {most:.1f} ms</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Joint, and id of its servo on the bus</source>
        <translation>关节，及其舵机在总线上的 id</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Position mm</source>
        <translation>位置 mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Where the joint is, and where that is within its envelope; darker ends: there it is slowed down</source>
        <translation>关节的位置，及其在行程范围内的位置；两端较暗处会减速</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Goal mm</source>
        <translation>目标 mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>The goal that the servo has taken</source>
        <translation>舵机已接受的目标</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Motor current in mA</source>
        <translation>电机电流，mA</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Temperature of the servo in °C</source>
        <translation>舵机温度，°C</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Supply voltage at the servo in V</source>
        <translation>舵机处的供电电压，V</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Torque</source>
        <translation>力矩</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Whether the motor holds</source>
        <translation>电机是否保持</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Zero</source>
        <translation>归零</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Whether the joint has been zeroed since the servo was switched on</source>
        <translation>舵机开启后关节是否已归零</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Error</source>
        <translation>错误</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>What the servo reports, or that it does not answer</source>
        <translation>舵机报告的错误，或没有应答</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>overload</source>
        <translation>过载</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>overload: the motor was pulled too hard for too long; free the wire</source>
        <translation>过载：电机受力过大过久；松开驱动丝</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>overheating</source>
        <translation>过热</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>overheating: let the servo cool down</source>
        <translation>过热：让舵机冷却</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>input voltage</source>
        <translation>输入电压</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>input voltage out of range: check the power supply</source>
        <translation>输入电压超出范围：检查电源</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>electric shock</source>
        <translation>电气冲击</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>electric shock on the circuit, or too little power for the motor</source>
        <translation>电路受到电气冲击，或供给电机的功率不足</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>encoder</source>
        <translation>编码器</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>encoder: the servo does not know where it is; have it repaired</source>
        <translation>编码器：舵机不知道自身位置；请送修</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>{reason}, {misses} times in a row</source>
        <translation>{reason}，连续 {misses} 次</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>{total} of {wanted_mm:.2f} mm</source>
        <translation>{wanted_mm:.2f} mm 中的 {total}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>bus {phase}</source>
        <translation>总线 {phase}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>bad packets {count}</source>
        <translation>坏包 {count}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>clamps {count}</source>
        <translation>限幅 {count}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>cycle: half of the periods of the last ten seconds were shorter than the first, 99 % than p99</source>
        <translation>周期：最近十秒内一半的周期短于前一个数，99 % 短于 p99</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Restart servo {id} ({joint})? It must be zeroed again.</source>
        <translation>重启舵机 {id}（{joint}）？之后须重新归零。</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>the servo gives {force:.0f} N at most ({duty:.0f} % of its duty)</source>
        <translation>舵机最多给出 {force:.0f} N（占空比 {duty:.0f} %）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>the servo gives {force:.0f} N at most ({most:.0f} mA)</source>
        <translation>舵机最多给出 {force:.0f} N（{most:.0f} mA）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>warning from {warm:g} °C, limit {hot:g} °C</source>
        <translation>{warm:g} °C 起警告，上限 {hot:g} °C</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>warning from {sags:g} V, limit {low:g} V</source>
        <translation>{sags:g} V 起警告，下限 {low:g} V</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>restarted</source>
        <translation>已重启</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>the servo restarted: zero its joint again</source>
        <translation>舵机重启过：请重新给关节归零</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>silent</source>
        <translation>无应答</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>not known before the joint is zeroed</source>
        <translation>关节归零前未知</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>bus watchdog</source>
        <translation>总线看门狗</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>nobody talked to the servo: arm again</source>
        <translation>舵机长时间未收到通信：请重新待命</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>slack</source>
        <translation>松弛</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>too tight</source>
        <translation>过紧</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>no servo bus: nothing is known about the servos</source>
        <translation>没有舵机总线：舵机情况未知</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>!! nothing heard from the servo bus for {seconds:.0f} s</source>
        <translation>!! 舵机总线已 {seconds:.0f} 秒无消息</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>cycle not measured yet</source>
        <translation>周期尚未测量</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Balance of the tendon pairs</source>
        <translation>驱动丝对的平衡</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Restart servo…</source>
        <translation>重启舵机…</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Zero…</source>
        <translation>归零…</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Torque off…</source>
        <translation>关闭力矩…</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Restart</source>
        <translation>重启</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>All motors let go and the wires hang loose.</source>
        <translation>所有电机放开，驱动丝松垂。</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Torque off</source>
        <translation>关闭力矩</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>its zero must be confirmed or set before arming: Zero...</source>
        <translation>就绪前须确认或设置其零点：设零…</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>see the servo's manual: hardware error status</source>
        <translation>见舵机手册：硬件错误状态</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>press STOP or Torque off first</source>
        <translation>请先停止或关闭力矩</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>the servo bus is not open</source>
        <translation>舵机总线未打开</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Restart one servo, which clears its error; its joint must be zeroed again</source>
        <translation>重启一个舵机以清除其错误；其关节须重新归零</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Say where the joints are: kept zeros, slack wires, and how far the feeds are in</source>
        <translation>说明各关节的位置：保留的零点、松弛的拉线，以及进给插入多深</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>Let all motors go, which releases the wires' tension; not while armed</source>
        <translation>松开所有电机，驱动丝随之松弛；待命时不可用</translation>
    </message>
    <message>
        <location filename="../../app/widgets/servo_table.py"/>
        <source>error {number}</source>
        <translation>错误 {number}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>Hold to move, release to stop</source>
        <translation>按住移动，松开停止</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>While the program drives</source>
        <translation>程序驾驶时</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>Keys</source>
        <translation>按键</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>deadman: it drives while held</source>
        <translation>使能键：按住期间驾驶</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>Any key above</source>
        <translation>以上任意键</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>you steer again, at once</source>
        <translation>立即重新由您操纵</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>Click</source>
        <translation>单击</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>target; right click clears it</source>
        <translation>设目标点；右击清除</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>Wheel, drag</source>
        <translation>滚轮，拖动</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>zoom the picture, move it</source>
        <translation>缩放图像，移动图像</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>go to a control, press or open it</source>
        <translation>移到控件，按下或打开</translation>
    </message>
    <message>
        <location filename="../../app/widgets/shortcut_page.py"/>
        <source>F1 or Esc closes this page</source>
        <translation>按 F1 或 Esc 关闭本页</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>LIVE</source>
        <translation>实机</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>real camera, no servos</source>
        <translation>真实相机，无舵机</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>A real camera looks; no servos that could move</source>
        <translation>由真实相机观察；没有会动的舵机</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>SIM</source>
        <translation>仿真</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>Everything here is simulated; no hardware moves. On a busy computer the simulation runs slower</source>
        <translation>这里的一切都是仿真；没有硬件运动。计算机繁忙时仿真会变慢</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>real servos move</source>
        <translation>真实舵机会动</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>Commands move real servos. Keep the power cut in reach</source>
        <translation>指令会驱动真实舵机。断电开关须伸手可及</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>recorded, not live</source>
        <translation>录制内容，非实时</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>Nothing here is happening now</source>
        <translation>此处所见并非正在发生</translation>
    </message>
    <message>
        <location filename="../../app/widgets/sim_banner.py"/>
        <source>{percent} % speed</source>
        <translation>{percent} % 速度</translation>
    </message>
    <message>
        <location filename="../../app/widgets/state_badge.py"/>
        <source>Waiting</source>
        <translation>等待中</translation>
    </message>
    <message>
        <location filename="../../app/widgets/state_badge.py"/>
        <source>unsure: {percent} %</source>
        <translation>不确定：{percent} %</translation>
    </message>
    <message>
        <location filename="../../app/widgets/state_badge.py"/>
        <source>{percent} % sure</source>
        <translation>确定度 {percent} %</translation>
    </message>
    <message>
        <location filename="../../app/widgets/state_badge.py"/>
        <source>No pose</source>
        <translation>无位姿</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Tour</source>
        <translation>导览</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>{place} of {count}</source>
        <translation>{place} / {count}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Tour, {place} of {count}</source>
        <translation>导览，{place} / {count}</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>{button}: tour</source>
        <translation>{button}：导览</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Done</source>
        <translation>完成</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Next</source>
        <translation>下一步</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>End the tour</source>
        <translation>结束导览</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Next stop of the tour</source>
        <translation>导览的下一站</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Back</source>
        <translation>上一步</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>The stop before  (Backspace)</source>
        <translation>上一站  (Backspace)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>Skip</source>
        <translation>跳过</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>End the tour  (Esc); Help, Tour shows it again</source>
        <translation>结束导览  (Esc)；“帮助”中的“导览”可再次显示</translation>
    </message>
    <message>
        <location filename="../../app/widgets/tour_overlay.py"/>
        <source>The next stop  (Enter)</source>
        <translation>下一站  (Enter)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/trend_plot.py"/>
        <source>Trends of theta, d_head and d_tail over the last 30 seconds</source>
        <translation>最近 30 秒 θ、d_head 和 d_tail 的趋势</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>leave as it is</source>
        <translation>保持不变</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>the kept zero holds</source>
        <translation>保留的零点有效</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>the wire is slack here</source>
        <translation>此处拉线松弛</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>the wire was hung in again, and is slack here</source>
        <translation>拉线已重新挂上，且此处松弛</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>rig file</source>
        <translation>装置文件</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>The rig wizard pulls each wire until the head follows (page Zero and pretension)</source>
        <translation>装置向导拉动每根拉线，直到头端跟随（“零点与预紧”页）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>Let all motors go; the wires spring back</source>
        <translation>放开所有电机；拉线会回弹</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>its servo does not answer</source>
        <translation>其舵机不应答</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>{at:+.2f} mm from its kept zero ({when})</source>
        <translation>距保留的零点 {at:+.2f} mm（{when}）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>last seen at {at:.1f} mm ({when})</source>
        <translation>上次见于 {at:.1f} mm（{when}）</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>, moved by {moved:+.1f} mm since</source>
        <translation>，此后移动了 {moved:+.1f} mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>Zero of {joint}</source>
        <translation>{joint} 的零点</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>it is at</source>
        <translation>现位于</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>Position of {joint}</source>
        <translation>{joint} 的位置</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>Set the position of {joint}</source>
        <translation>设置 {joint} 的位置</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>Where the joints are</source>
        <translation>各关节的位置</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>&amp;Search for slack...</source>
        <translation>寻找松弛点(&amp;S)...</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>&amp;Torque off</source>
        <translation>断开扭矩(&amp;T)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>at {at:.2f} mm</source>
        <translation>位于 {at:.2f} mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>at {at:.1f} mm</source>
        <translation>位于 {at:.1f} mm</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>no kept zero that fits</source>
        <translation>没有合适的保留零点</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>not known: measure how far it is in</source>
        <translation>未知：请测量其插入深度</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>its servo holds: the torque must be off for a wire to be slack</source>
        <translation>其舵机在保持：只有断开扭矩，拉线才会松弛</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>S&amp;et</source>
        <translation>设置(&amp;E)</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>A tendon has no kept zero: search for slack, which pulls each wire until the head follows. By hand: torque off, see that the wire is slack, and say so.</source>
        <translation>有拉线没有保留的零点：寻找松弛点，即拉动每根拉线直到头端跟随。手动：断开扭矩，查看拉线是否松弛，并如此说明。</translation>
    </message>
    <message>
        <location filename="../../app/widgets/zero_dialog.py"/>
        <source>A kept zero holds as long as the wire was not hung in again. Say how far robot and catheter are in: measure it.</source>
        <translation>只要拉线没有重新挂过，保留的零点就有效。请说明机器人和导管插入多深：测量它。</translation>
    </message>
    <message>
        <location filename="../../core/annotation/model.py"/>
        <source>robot line &lt; {a} px</source>
        <translation>机器人线 &lt; {a} px</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>the empty picture is blurred (sharpness {found}): focus the camera and take another</source>
        <translation>空台架图像模糊（清晰度 {found}）：请对焦后重新拍摄</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{count} frames are too few: move the robot to three places</source>
        <translation>{count} 帧太少：请把机器人移到三个位置</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>the vessel mask has {a}x{b} px, the pictures {width}x{height}: draw it on one of them</source>
        <translation>血管掩膜为 {a}x{b} px，图像为 {width}x{height}：请在其中一张图像上绘制</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>the vessel mask covers {share} of the picture: white must be the vessel</source>
        <translation>血管掩膜覆盖图像的 {share}：白色必须是血管</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: was made for a working size of {a} px, and {b} px are set; make the bench again</source>
        <translation>{path}：按工作尺寸 {a} px 建立，而设置为 {b} px；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: format {found} is of a newer version; update the program</source>
        <translation>{path}：格式 {found} 来自更新的版本；请更新程序</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: its pictures are damaged; make the bench again</source>
        <translation>{path}：其图像已损坏；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: its pictures differ in size; make the bench again</source>
        <translation>{path}：其图像尺寸不一；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>empty picture {number} shows another bench, or the camera was moved (likeness {found})</source>
        <translation>空台架图像 {number} 显示另一台架，或相机被移动（相似度 {found}）</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>frame {number} shows another bench, or the camera was moved</source>
        <translation>第 {number} 帧显示另一台架，或相机被移动</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>picture {number} has {a}x{b} px, the first {width}x{height}: take all with the same camera</source>
        <translation>图像 {number} 为 {a}x{b} px，第一张为 {width}x{height}：请用同一相机拍摄全部图像</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: cannot be read ({why}); make the bench again</source>
        <translation>{path}：无法读取（{why}）；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: damaged ({why}); make the bench again</source>
        <translation>{path}：已损坏（{why}）；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: names {name}, which no bench has; make the bench again</source>
        <translation>{path}：指定了 {name}，台架中没有此项；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: cut or damaged (SHA-256); make the bench again</source>
        <translation>{path}：被截断或已损坏 (SHA-256)；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: lacks a picture ({why}); make the bench again</source>
        <translation>{path}：缺少图像（{why}）；请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: cannot be read ({why})</source>
        <translation>{path}：无法读取（{why}）</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: exists and is no bench; choose another folder</source>
        <translation>{path}：已存在且不是台架；请选择另一文件夹</translation>
    </message>
    <message>
        <location filename="../../core/bench/bench.py"/>
        <source>{path}: cannot be written ({why}); make room, or choose another folder</source>
        <translation>{path}：无法写入（{why}）；请腾出空间，或选择另一文件夹</translation>
    </message>
    <message>
        <location filename="../../core/bench/registration.py"/>
        <source>the picture has {a}x{b} px at working size, the bench {width}x{height}</source>
        <translation>图像在工作尺寸下为 {a}x{b} px，台架为 {width}x{height}</translation>
    </message>
    <message>
        <location filename="../../core/bench/registration.py"/>
        <source>likeness {found} (at least {least}): make the bench again, or put the camera back</source>
        <translation>相似度 {found}（至少 {least}）：请重新建立台架，或把相机放回原位</translation>
    </message>
    <message>
        <location filename="../../core/bench/registration.py"/>
        <source>by {shift} px and {rotation} degrees (at most {a} px, {b} degrees): make the bench again</source>
        <translation>移动了 {shift} px 和 {rotation} 度（最多 {a} px，{b} 度）：请重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/bench/registration.py"/>
        <source>the vessel alone, by about {shift} px against what lies around it: put it back, or make the bench again</source>
        <translation>仅血管移动，相对周围约 {shift} px：请放回原位，或重新建立台架</translation>
    </message>
    <message>
        <location filename="../../core/calibration/camera.py"/>
        <source>{a} of its markers and {b} of its {c} corners are seen</source>
        <translation>看到 {a} 个标记和 {c} 个角点中的 {b} 个</translation>
    </message>
    <message>
        <location filename="../../core/calibration/camera.py"/>
        <source>a board of {a} x {b} squares needs {c} markers, and there are {count}: take fewer squares</source>
        <translation>{a} x {b} 格的标定板需要 {c} 个标记，但只有 {count} 个：请减少格数</translation>
    </message>
    <message>
        <location filename="../../core/calibration/servos.py"/>
        <source>the feed goes by about {a} mm at one turn of the servo's horn, as the camera saw it, and is configured with {b} mm: measure the diameter of its wheel (page Drums)</source>
        <translation>相机所见舵盘每转进给约 {a} mm，而设置为 {b} mm：请测量其轮子的直径（“绕线轮”页）</translation>
    </message>
    <message>
        <location filename="../../core/calibration/servos.py"/>
        <source>head {a} px to the {side}</source>
        <translation>头端向{side} {a} px</translation>
    </message>
    <message>
        <location filename="../../core/calibration/servos.py"/>
        <source>head {a} px forward</source>
        <translation>头端前进 {a} px</translation>
    </message>
    <message>
        <location filename="../../core/calibration/servos.py"/>
        <source>{a} px less of the robot seen</source>
        <translation>看到的机器人缩短 {a} px</translation>
    </message>
    <message>
        <location filename="../../core/calibration/servos.py"/>
        <source>sheath {a} px farther</source>
        <translation>鞘管前进 {a} px</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{path}: {why}; it is kept as {name}, and the defaults are used</source>
        <translation>{path}：{why}；文件保留为 {name}，并使用默认值</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{name} {why}: the old one is kept as {kept}</source>
        <translation>{name} {why}：旧文件保留为 {kept}</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>is no TOML ({why})</source>
        <translation>不是 TOML 文件（{why}）</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{path}: {why}, and cannot be set aside ({trouble}); the defaults are used</source>
        <translation>{path}：{why}，且无法移开（{trouble}）；使用默认值</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{path}: cannot be written ({why}); nothing was changed</source>
        <translation>{path}：无法写入（{why}）；没有任何更改</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{path}: cannot be read ({why}); the defaults are used</source>
        <translation>{path}：无法读取（{why}）；使用默认值</translation>
    </message>
    <message>
        <location filename="../../core/config/files.py"/>
        <source>{path}: {why}; the defaults are used</source>
        <translation>{path}：{why}；使用默认值</translation>
    </message>
    <message>
        <location filename="../../core/config/rig_file.py"/>
        <source>a rig cannot be called {name}: choose another name</source>
        <translation>台架不能叫 {name}：请换一个名称</translation>
    </message>
    <message>
        <location filename="../../core/config/schema.py"/>
        <source>{a} to {rest}</source>
        <translation>{a} 至 {rest}</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>{joint} up to {a} mA for {b} ms (its {c} N are {d} mA)</source>
        <translation>{joint} 在 {b} ms 内达到 {a} mA（其 {c} N 为 {d} mA）</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>{joint} off by {a} mm (at most {b} mm)</source>
        <translation>{joint}偏差 {a} mm（最多 {b} mm）</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>{a} in {b} s (at most {c})</source>
        <translation>{b} s 内 {a} 个（最多 {c}）</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>{a} V at most</source>
        <translation>最多 {a} V</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>silent for {a} ms</source>
        <translation>{a} ms 无响应</translation>
    </message>
    <message>
        <location filename="../../core/control/bus_monitor.py"/>
        <source>for {a} ms</source>
        <translation>已 {a} ms</translation>
    </message>
    <message>
        <location filename="../../core/control/camera_monitor.py"/>
        <source>by {a} px (at most {b} px)</source>
        <translation>{a} px（最多 {b} px）</translation>
    </message>
    <message>
        <location filename="../../core/control/camera_monitor.py"/>
        <source>{a} identical pictures</source>
        <translation>{a} 张相同图像</translation>
    </message>
    <message>
        <location filename="../../core/control/camera_monitor.py"/>
        <source>{a} until now</source>
        <translation>至今 {a} 个</translation>
    </message>
    <message>
        <location filename="../../core/control/camera_monitor.py"/>
        <source>{a} in a row</source>
        <translation>连续 {a} 次</translation>
    </message>
    <message>
        <location filename="../../core/control/camera_monitor.py"/>
        <source>{a} frames</source>
        <translation>{a} 帧</translation>
    </message>
    <message>
        <location filename="../../core/control/direction_monitor.py"/>
        <source>{a}° against a bend of {b}° to the {side}</source>
        <translation>{a}°，而弯曲为向{side} {b}°</translation>
    </message>
    <message>
        <location filename="../../core/control/direction_monitor.py"/>
        <source>{a} mm against a feed of {b} mm</source>
        <translation>{a} mm，而进给为 {b} mm</translation>
    </message>
    <message>
        <location filename="../../core/control/engine.py"/>
        <source>the camera's picture is {kind} {shape}, not 8-bit RGB: set its colour format</source>
        <translation>相机图像为 {kind} {shape}，不是 8 位 RGB：请设置其颜色格式</translation>
    </message>
    <message>
        <location filename="../../core/control/gate.py"/>
        <source>{joint} at {a} mm ({b} to {c} mm)</source>
        <translation>{joint}在 {a} mm（{b} 至 {c} mm）</translation>
    </message>
    <message>
        <location filename="../../core/control/gate.py"/>
        <source>{joint} to {a} mm ({b} to {c} mm)</source>
        <translation>{joint}到 {a} mm（{b} 至 {c} mm）</translation>
    </message>
    <message>
        <location filename="../../core/control/gate.py"/>
        <source>{joint} by {a} mm (at most {b} mm)</source>
        <translation>{joint}相差 {a} mm（最多 {b} mm）</translation>
    </message>
    <message>
        <location filename="../../core/control/gate.py"/>
        <source>{joint} at {a} mm, sent to {b} mm</source>
        <translation>{joint}在 {a} mm，指令为 {b} mm</translation>
    </message>
    <message>
        <location filename="../../core/control/gate.py"/>
        <source>measured position: {what}</source>
        <translation>测得位置：{what}</translation>
    </message>
    <message>
        <location filename="../../core/control/kept_zero.py"/>
        <source>{joint} is no joint of this robot: {names}</source>
        <translation>{joint} 不是此机器人的关节:{names}</translation>
    </message>
    <message>
        <location filename="../../core/control/kept_zero.py"/>
        <source>{joint} cannot be at {a} mm: give {b} to {c} mm</source>
        <translation>{joint} 不可能位于 {a} mm：请给出 {b} 到 {c} mm</translation>
    </message>
    <message>
        <location filename="../../core/control/kept_zero.py"/>
        <source>{joint}: a tendon is zeroed where its wire is slack, at 0 mm</source>
        <translation>{joint}：拉线在其松弛处设零，即 0 mm</translation>
    </message>
    <message>
        <location filename="../../core/control/kept_zero.py"/>
        <source>{joint} stands {a} mm from its kept zero: use that, or forget it if the wire was hung in again</source>
        <translation>{joint} 距其保留的零点 {a} mm：使用该零点，若拉线重新挂过则放弃它</translation>
    </message>
    <message>
        <location filename="../../core/control/kept_zero.py"/>
        <source>{joint} has no kept zero that fits: give its position, or search for it (menu Rig, Calibrate)</source>
        <translation>{joint} 没有合适的保留零点：请给出其位置，或寻找它（“装置”菜单，标定）</translation>
    </message>
    <message>
        <location filename="../../core/control/pilot.py"/>
        <source>driving stopped by an unexpected {kind}: {why}; start the rig again</source>
        <translation>驾驶因意外的 {kind} 停止：{why}；请重新启动装置</translation>
    </message>
    <message>
        <location filename="../../core/control/pilot.py"/>
        <source>the computer slept for {a} s</source>
        <translation>计算机休眠了 {a} s</translation>
    </message>
    <message>
        <location filename="../../core/control/policies.py"/>
        <source>crossed the centerline to the {side}, angle left</source>
        <translation>已向{side}侧越过中心线，仍有夹角</translation>
    </message>
    <message>
        <location filename="../../core/control/policies.py"/>
        <source>coming back to the centerline from the {side}</source>
        <translation>正从{side}侧回到中心线</translation>
    </message>
    <message>
        <location filename="../../core/control/policies.py"/>
        <source>moving away from the centerline to the {side}</source>
        <translation>正向{side}侧偏离中心线</translation>
    </message>
    <message>
        <location filename="../../core/control/pursuit.py"/>
        <source>backing off: {why}</source>
        <translation>后退：{why}</translation>
    </message>
    <message>
        <location filename="../../core/control/pursuit.py"/>
        <source>missed the branch {a} times: take over, or choose another target</source>
        <translation>已 {a} 次错过该分支：请接管，或另选目标点</translation>
    </message>
    <message>
        <location filename="../../core/control/pursuit.py"/>
        <source>{why}; a branch ahead may turn more sharply than the head bends</source>
        <translation>{why}；前方分支的转角可能超过头部的弯曲能力</translation>
    </message>
    <message>
        <location filename="../../core/control/pursuit.py"/>
        <source>came no farther in {a} tries: take over, or choose another target</source>
        <translation>尝试 {a} 次仍未前进：请接管，或另选目标点</translation>
    </message>
    <message>
        <location filename="../../core/control/servo_requests.py"/>
        <source>restarting servo {a}</source>
        <translation>正在重启舵机 {a}</translation>
    </message>
    <message>
        <location filename="../../core/control/servo_requests.py"/>
        <source>{what} failed ({kind}: {why}): start the rig again</source>
        <translation>{what}失败（{kind}：{why}）：请重新启动装置</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>in pieces: the robot's mask has {a}, the largest {b} % of it</source>
        <translation>断成数段：机器人掩膜有 {a} 段，最大一段占 {b} %</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>a hand or a shadow: the mask has {a} times the usual area</source>
        <translation>手或阴影：掩膜面积是通常的 {a} 倍</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>of another width: the mask has {a} px, the others {b} px</source>
        <translation>宽度不同：掩膜宽 {a} px，其他为 {b} px</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>doubtful: {a} % of the robot's mask (at most {b} %)</source>
        <translation>可疑：机器人掩膜的 {a} %（最多 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>beside the vessel: {a} % of the robot's mask lie in it (at least {b} %)</source>
        <translation>在血管之外：机器人掩膜有 {a} % 在血管内（至少 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>blurred: {a} % of the empty picture's fine structure</source>
        <translation>模糊：只有空台架图像精细结构的 {a} %</translation>
    </message>
    <message>
        <location filename="../../core/learning/teaching.py"/>
        <source>a hand or a shadow: {a} % of the bench are hidden</source>
        <translation>手或阴影：台架有 {a} % 被遮挡</translation>
    </message>
    <message>
        <location filename="../../core/perception/centerline.py"/>
        <source>the target is {a} px beside the vessel</source>
        <translation>目标偏离血管 {a} px</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>99 % of it is brighter than {a} (overexposed above {b} of 255)</source>
        <translation>99 % 的像素亮于 {a}（255 级中高于 {b} 视为过曝）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>distance {a} from the pictures that it knows (at most {b})</source>
        <translation>与已知图像的距离为 {a}（最多 {b}）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>its mask has no centerline, or more than {a} branches</source>
        <translation>其掩膜没有中心线，或分支超过 {a} 条</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>{a} % of the robot is bridged (at most {b} %)</source>
        <translation>机器人有 {a} % 是桥接的（最多 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>{a} % of its last {b} px lie in the vessel (at least {c} %)</source>
        <translation>其末段 {b} px 中有 {a} % 在血管内（至少 {c} %）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>its head is {a} px from the nearest centerline (at most {b} px)</source>
        <translation>机器人头端距最近的中心线 {a} px（最多 {b} px）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>a second branch fits {a} % as well (at most {b} %)</source>
        <translation>另一分支的吻合度也有 {a} %（最多 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>99 % of it is darker than {a} (black below {b} of 255)</source>
        <translation>99 % 的像素暗于 {a}（255 级中低于 {b} 视为全黑）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>what looks like it covers {a} % of the image (at most {b} %)</source>
        <translation>疑似部分占图像的 {a} %（最多 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>{a} px long (at least {b} px)</source>
        <translation>长 {a} px（至少 {b} px）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>{a} % (at least {b} %)</source>
        <translation>{a} %（至少 {b} %）</translation>
    </message>
    <message>
        <location filename="../../core/perception/quality.py"/>
        <source>sharpness {a} (at least {b})</source>
        <translation>清晰度 {a}（至少 {b}）</translation>
    </message>
    <message>
        <location filename="../../core/perception/tracking.py"/>
        <source>{a} px since the last frame (at most {b} px)</source>
        <translation>与上一帧相差 {a} px（最多 {b} px）</translation>
    </message>
    <message>
        <location filename="../../core/session/reader.py"/>
        <source>{path}: cannot be read as a video ({why})</source>
        <translation>{path}：无法作为视频读取（{why}）</translation>
    </message>
    <message>
        <location filename="../../core/session/writer.py"/>
        <source>disk nearly full: {left} MB left</source>
        <translation>磁盘空间即将不足：剩余 {left} MB</translation>
    </message>
    <message>
        <location filename="../../core/session/writer.py"/>
        <source>disk full ({left} MB left in {folder})</source>
        <translation>磁盘已满（{folder} 中仅剩 {left} MB）</translation>
    </message>
    <message>
        <location filename="../../core/session/writer.py"/>
        <source>{why}; make room and save them again</source>
        <translation>{why}；请腾出空间后再次保存</translation>
    </message>
    <message>
        <location filename="../../core/session/writer.py"/>
        <source>the last seconds were not saved: {why}</source>
        <translation>最近几秒未能保存：{why}</translation>
    </message>
    <message>
        <location filename="../../core/session/writer.py"/>
        <source>of the last seconds only {a} of {b} frames were saved: {why}</source>
        <translation>最近几秒只保存了 {b} 帧中的 {a} 帧：{why}</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>board {a}: {b} of {c} corners</source>
        <translation>标定板 {a}：{c} 个角点中的 {b} 个</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>scale: {a} mm/px, ±{b} %</source>
        <translation>比例：{a} mm/px，±{b} %</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>servos at several speeds: {ids} at {a} baud; {others}; set all to one</source>
        <translation>舵机波特率不一致：{ids} 为 {a} baud；{others}；请全部设为同一波特率</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>{count} servos at {a} baud: {ids}</source>
        <translation>{a} 波特，{count} 个舵机：{ids}</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>steering: roll {a}°, way and heading {b}° from a right angle, the head turns by {c}° per mm</source>
        <translation>转向：滚转 {a}°，方向与航向偏离直角 {b}°，每毫米拉线头端转 {c}°</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>lens: up to {a} px at the border, {b} px left over</source>
        <translation>镜头：边缘处最多 {a} px，残差 {b} px</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>lens: straight enough ({a} px at the border)</source>
        <translation>镜头：足够直（边缘处 {a} px）</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/rig_draft.py"/>
        <source>where the servos stand could not be kept ({why}): learn the steering, which keeps it, too</source>
        <translation>舵机当前位置未能保存（{why}）：请学习转向，其结果会一并保存</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_identification.py"/>
        <source>servo {a}: nothing clear was seen</source>
        <translation>舵机 {a}：没有看到明确的变化</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_identification.py"/>
        <source>tendon {name} does not stand at its kept zero: find the zeros first</source>
        <translation>拉线 {name} 不在其保留的零点：请先寻找零点</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_identification.py"/>
        <source>servo {a}: {b} mm both ways</source>
        <translation>舵机 {a}：来回 {b} mm</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_identification.py"/>
        <source>{joint}: {a} mm of pull, {b} px of way</source>
        <translation>{joint}：牵拉 {a} mm，位移 {b} px</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_identification.py"/>
        <source>servo {a} {function} ({seen}), direction {sign}</source>
        <translation>舵机 {a}{function}（{seen}），方向 {sign}</translation>
    </message>
    <message>
        <location filename="../../hardware/calibration/servo_probe.py"/>
        <source>too much current: {names}; the servos were let go: something holds the wires</source>
        <translation>电流过大：{names}；舵机已放开：有东西卡住驱动丝</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>pypylon cannot be loaded ({why}): pip install --force-reinstall pypylon</source>
        <translation>无法载入 pypylon（{why}）：pip install --force-reinstall pypylon</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>pylon cannot look for cameras: {why}</source>
        <translation>pylon 无法查找相机：{why}</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} {serial} is not there any more: check its cable and supply</source>
        <translation>{camera} {serial} 已不在：检查其线缆和电源</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{a} Basler cameras ({serials}): set camera.serial to one of them</source>
        <translation>{a} 台 Basler 相机（{serials}）：将 camera.serial 设为其中之一</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>no Basler camera {serial}; there are: {serials}: set camera.serial to one of them</source>
        <translation>没有 Basler 相机 {serial}；现有：{serials}：将 camera.serial 设为其中之一</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>no Basler camera: check its cable and supply; main.py doctor --rig basler says more</source>
        <translation>没有 Basler 相机：检查其线缆和电源；main.py doctor --rig basler 给出更多信息</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} gives {rate} pictures/s at {size}: set camera.frames_per_second or camera.exposure_ms lower</source>
        <translation>{camera} 在 {size} 时为每秒 {rate} 帧：调低 camera.frames_per_second 或 camera.exposure_ms</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} has no {size}: set camera.width_px to {widths}, and camera.height_px to {heights}</source>
        <translation>{camera} 没有 {size}：将 camera.width_px 设为 {widths}，camera.height_px 设为 {heights}</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>Basler cameras need the package pypylon: pip install pypylon</source>
        <translation>Basler 相机需要软件包 pypylon：pip install pypylon</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} cannot be started ({why}): close other programs that use it</source>
        <translation>{camera}无法启动（{why}）：关闭使用它的其他程序</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} is lost ({why}): check its cable</source>
        <translation>{camera}断开（{why}）：检查其线缆</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/basler.py"/>
        <source>{camera} is lost: check its cable</source>
        <translation>{camera}断开：检查其线缆</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/files.py"/>
        <source>{path}: end of the video</source>
        <translation>{path}：视频结束</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/live.py"/>
        <source>the driver of {camera} does not return: plug the camera out and in again</source>
        <translation>{camera}的驱动程序没有返回：拔下相机再重新插入</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/live.py"/>
        <source>{camera} gives no pictures: check its cable</source>
        <translation>{camera}没有给出图像：检查其线缆</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/realsense.py"/>
        <source>{camera} {serial} is not there any more (there are: {serials}): plug it in, or start again with another one</source>
        <translation>{camera} {serial} 已不在（现有：{serials}）：请插上，或换另一台重新启动</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>plug it into a USB 3 port; on a network: its supply, its cable, and an address in this computer's network</source>
        <translation>插入 USB 3 端口；网络相机：检查电源、线缆，以及本机网段内的地址</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>RealSense cameras need the package pyrealsense2: {command}</source>
        <translation>RealSense 相机需要软件包 pyrealsense2:{command}</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>no Basler camera {serial}; there are: {serials}</source>
        <translation>没有 Basler 相机 {serial}；现有：{serials}</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>{camera} is plugged in, but cannot be opened</source>
        <translation>{camera} 已插入，但无法打开</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>no Basler camera</source>
        <translation>没有 Basler 相机</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>RealSense cameras need the package pyrealsense2</source>
        <translation>RealSense 相机需要软件包 pyrealsense2</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>no permission for {node}</source>
        <translation>没有 {node} 的权限</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>Basler cameras need the package pypylon</source>
        <translation>Basler 相机需要软件包 pypylon</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/registry.py"/>
        <source>{a} Basler cameras: {serials}</source>
        <translation>{a} 台 Basler 相机：{serials}</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/webcam.py"/>
        <source>{camera} ({node}) cannot be opened: close other programs that use it, or join the group video</source>
        <translation>{camera}（{node}）无法打开：关闭使用它的其他程序，或加入 video 组</translation>
    </message>
    <message>
        <location filename="../../hardware/cameras/webcam.py"/>
        <source>webcam {camera} is not there; webcams: {paths}: plug it in, or set camera.device</source>
        <translation>网络摄像头 {camera} 不存在；现有：{paths}：请插入，或设置 camera.device</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/gamepad.py"/>
        <source>{path} is no gamepad with two sticks: leave gamepad.device out to take the first that there is</source>
        <translation>{path} 不是双摇杆手柄：不设 gamepad.device 以使用第一个手柄</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/gamepad.py"/>
        <source>gamepad {name} has its right stick and buttons elsewhere: switch it to XInput, or take another one</source>
        <translation>手柄 {name} 的右摇杆和按键布局不同：把它切换到 XInput，或换一个手柄</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/gamepad.py"/>
        <source>the gamepad is no longer read ({kind}: {why}): start the program again</source>
        <translation>不再读取手柄（{kind}：{why}）：请重新启动程序</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/gamepad.py"/>
        <source>no permission for gamepad {path}: add your user to the group input, then log in again</source>
        <translation>没有手柄 {path} 的权限：把您的用户加入 input 组，然后重新登录</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>{port} cannot be used as pedal port at {a} baud ({why}): set pedal.port and pedal.baud</source>
        <translation>{port} 不能以 {a} 波特用作脚踏板端口（{why}）：设置 pedal.port 和 pedal.baud</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>the pedal at {port} is gone: plug its USB cable in</source>
        <translation>脚踏板 {port} 断开：插好其 USB 线</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>pedal port {port} does not exist: plug the pedal in, or set pedal.port</source>
        <translation>脚踏板端口 {port} 不存在：插入脚踏板，或设置 pedal.port</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>no permission for pedal port {port}: add your user to the group dialout, then log in again</source>
        <translation>没有脚踏板端口 {port} 的权限：把您的用户加入 dialout 组，然后重新登录</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>pedal port {port} is in use by another program, or by the servos: close it there, or set pedal.port</source>
        <translation>脚踏板端口 {port} 正被另一个程序或舵机使用：在那里关闭它，或设置 pedal.port</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>pedal port {port} has no device behind it: unplug the pedal and plug it in again</source>
        <translation>脚踏板端口 {port} 后面没有设备：拔下脚踏板并重新插入</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>the pedal at {port} has not reported yet</source>
        <translation>脚踏板 {port} 尚未报告</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>the pedal is no longer read ({kind}: {why}): start the program again</source>
        <translation>不再读取脚踏板（{kind}：{why}）：请重新启动程序</translation>
    </message>
    <message>
        <location filename="../../hardware/inputs/pedal.py"/>
        <source>the pedal at {port} is gone ({why}): plug its USB cable in</source>
        <translation>脚踏板 {port} 断开（{why}）：插好其 USB 线</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>{folder}: {a} GB free of {b} GB</source>
        <translation>{folder}：{b} GB 中剩余 {a} GB</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>now {time} UTC</source>
        <translation>现在 {time} UTC</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>{a} as pinned</source>
        <translation>{a} 个均为指定版本</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>{a} can be loaded</source>
        <translation>{a} 个可以加载</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>close other programs: {a} GB must be free, and {b} GB there in all</source>
        <translation>关闭其他程序：须有 {a} GB 空闲，共 {b} GB</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>make room ({a} GB or more), or set record.folder to another disk</source>
        <translation>腾出空间（{a} GB 或更多），或把 record.folder 设到另一个磁盘</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>missing: {names}</source>
        <translation>缺少：{names}</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/checks.py"/>
        <source>QT_QPA_PLATFORM={name}: nothing is shown on a screen</source>
        <translation>QT_QPA_PLATFORM={name}：屏幕上不显示任何内容</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{a}x{b}, {rate} frames/s, {c} lost, brightness {light} of 255</source>
        <translation>{a}x{b}，{rate} 帧/秒，丢失 {c}，亮度 {light} / 255</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{a} answer, {models}, firmware {rest}</source>
        <translation>{a} 个应答，{models}，固件 {rest}</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>it should give {a}: more light, camera.exposure_ms below {b}, or a USB 3 port without a hub</source>
        <translation>应达到 {a}：增加光照，camera.exposure_ms 低于 {b}，或不经集线器的 USB 3 端口</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port} is in use by another program</source>
        <translation>{port} 正被另一个程序使用</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{baud} baud</source>
        <translation>{baud} 波特</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port} is silent</source>
        <translation>{port} 无响应</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{a} frames in {b} s</source>
        <translation>{b} s 内 {a} 帧</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port} is no serial port</source>
        <translation>{port} 不是串口</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port} is free</source>
        <translation>{port} 空闲</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>the supply must give {a} V or more at servo {joint}</source>
        <translation>舵机 {joint} 处的电源必须不低于 {a} V</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>what comes from {port} is no pedal's report</source>
        <translation>{port} 传来的不是脚踏板的报告</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>let {joint} cool below {a} °C</source>
        <translation>让 {joint} 冷却到 {a} °C 以下</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port}: the E-stop is pressed, or its wire is broken</source>
        <translation>{port}：急停已按下，或其导线断开</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/device_checks.py"/>
        <source>{port}: STOP is pressed, or its wire is broken</source>
        <translation>{port}：停止已按下，或其接线断开</translation>
    </message>
    <message>
        <location filename="../../hardware/preflight/model_checks.py"/>
        <source>{name}: all {count} files are whole (SHA-256)</source>
        <translation>{name}：全部 {count} 个文件完整（SHA-256）</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/bus_guard.py"/>
        <source>not armed: {why}</source>
        <translation>未待命：{why}</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/bus_ipc.py"/>
        <source>the servo bus process did not answer within {a} s: connect the robot again</source>
        <translation>舵机总线进程在 {a} 秒内没有应答：请重新连接机器人</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/bus_process.py"/>
        <source>not armed: {why}; check its supply and cable</source>
        <translation>未待命：{why}；请检查其供电和电缆</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/bus_process.py"/>
        <source>not zeroed: {why}; check its supply and cable</source>
        <translation>未设零：{why}；检查其电源和线缆</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/discovery.py"/>
        <source>{baud} baud: about {a} cycles a second instead of {b}</source>
        <translation>{baud} 波特：每秒约 {a} 个周期，而非 {b}</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/drive.py"/>
        <source>torque of {names} is not proven to be off: cut the servos' power</source>
        <translation>未能证实{names}的力矩已关闭：请切断舵机电源</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/drive.py"/>
        <source>{names}: no answer; check the drive's power, its cable and servos.baud</source>
        <translation>{names}:没有应答;请检查驱动器的电源、线缆和 servos.baud</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/drive.py"/>
        <source>{joint} holds its wire: switch the torque off and see that it is slack</source>
        <translation>{joint} 正拉着拉线:请断开扭矩,并确认拉线已松弛</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_bus.py"/>
        <source>{joint} holds its wire: let the wizard search where it is taut (menu Rig, Calibrate), or switch the torque off and see that it is slack</source>
        <translation>{joint} 仍拉着拉线：让向导寻找绷紧点（“装置”菜单，标定），或断开扭矩并查看其是否松弛</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_bus.py"/>
        <source>{joint} pulls with {a} mA (friction takes {b} mA at most): slacken its wire, then zero it</source>
        <translation>{joint} 以 {a} mA 拉动（摩擦最多 {b} mA）：放松其拉线，然后设零</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_bus.py"/>
        <source>{joint} holds with another {what}: close the program with Relax slowly, or switch the torque off (the wires go slack), then arm</source>
        <translation>{joint} 正以不同的 {what} 保持:请用“缓慢放松”关闭程序,或断开扭矩(拉线会松弛),然后再就绪</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>{port} cannot be used as servo port ({why}): set servos.port to the USB adapter</source>
        <translation>{port} 不能用作舵机端口（{why}）：把 servos.port 设为 USB 适配器</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} is in use by another program: close that program first</source>
        <translation>舵机端口 {port} 正被另一个程序使用：先关闭那个程序</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} does not exist: plug the USB adapter in, or set servos.port</source>
        <translation>舵机端口 {port} 不存在：插入 USB 适配器，或设置 servos.port</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>no permission for servo port {port}: add your user to the group dialout, then log in again</source>
        <translation>没有舵机端口 {port} 的权限：把您的用户加入 dialout 组，然后重新登录</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} has no device behind it: unplug the USB adapter and plug it in again</source>
        <translation>舵机端口 {port} 后面没有设备：拔下 USB 适配器再重新插入</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} is in use by another program, {who}: close that program first</source>
        <translation>舵机端口 {port} 正被另一程序使用，{who}：请先关闭该程序</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo {a}: {miss}, {b} times: check its supply and cable, and that no two servos have the same id</source>
        <translation>舵机 {a}：{miss}，{b} 次：检查其供电和线缆，并确认没有两个舵机的 id 相同</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} vanished while it was opened ({why}): check the USB cable</source>
        <translation>舵机端口 {port} 在打开时消失（{why}）：检查 USB 线</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/dynamixel_port.py"/>
        <source>servo port {port} is lost ({why}): check the USB cable, then connect again</source>
        <translation>舵机端口 {port} 断开（{why}）：检查 USB 线，然后重新连接</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/eeprom.py"/>
        <source>{path}: the servo's EEPROM cannot be saved ({why}), so it is not changed: make room, or the folder writable</source>
        <translation>{path}：无法保存舵机的 EEPROM（{why}），因此不作更改：请腾出空间，或使该文件夹可写</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/tracking.py"/>
        <source>{joint} stays at {a} mm, outside its envelope ({b} to {c} mm)</source>
        <translation>{joint}停在 {a} mm，超出行程范围（{b} 至 {c} mm）</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/tracking.py"/>
        <source>{joint} went {a} mm where nobody sent it</source>
        <translation>{joint}未经指令移动了 {a} mm</translation>
    </message>
    <message>
        <location filename="../../hardware/servos/tracking.py"/>
        <source>{joint} stands {a} mm from its goal for {b} ms</source>
        <translation>{joint}停在距目标 {a} mm 处已 {b} ms</translation>
    </message>
    <message>
        <location filename="../../hardware/twin/own_phantom.py"/>
        <source>the twin has a phantom of this bench: gui --bench {folder}</source>
        <translation>数字孪生已有此台架的体模：gui --bench {folder}</translation>
    </message>
    <message>
        <location filename="../../hardware/twin/own_phantom.py"/>
        <source>calibrate the rig, or say how much the picture shows: python main.py phantom {folder} --width-mm MM</source>
        <translation>请标定装置，或说明画面的实际宽度：python main.py phantom {folder} --width-mm MM</translation>
    </message>
    <message>
        <location filename="../../hardware/twin/own_phantom.py"/>
        <source>the twin has no phantom of this bench: {why}</source>
        <translation>数字孪生没有此台架的体模：{why}</translation>
    </message>
    <message>
        <location filename="../../hardware/twin/own_phantom.py"/>
        <source>the twin's phantom of this bench stays as it was: {why}</source>
        <translation>数字孪生中此台架的体模保持不变：{why}</translation>
    </message>
    <message>
        <location filename="../../hardware/twin/process.py"/>
        <source>the bench twin stopped ({why}): start the rig again (F5)</source>
        <translation>数字孪生台架停止（{why}）：请重新启动装置 (F5)</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ADVISORY</source>
        <translation>建议模式</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ARMED</source>
        <translation>待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>AUTONOMOUS</source>
        <translation>自主模式</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>HOLD</source>
        <translation>保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>STOPPED</source>
        <translation>已停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>stop</source>
        <translation>停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge</source>
        <translation>确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>arm</source>
        <translation>进入待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>hand over</source>
        <translation>移交控制</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take back</source>
        <translation>收回控制</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>disarm</source>
        <translation>解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>port closed</source>
        <translation>端口已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>disarmed</source>
        <translation>未待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>armed</source>
        <translation>待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>quiet</source>
        <translation>静默</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>was no TOML</source>
        <translation>不是 TOML 文件</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>was changed meanwhile</source>
        <translation>在此期间被修改</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>had values that are not allowed</source>
        <translation>含有不允许的值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>too much is wrong</source>
        <translation>错误过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>delivery_1</source>
        <translation>鞘管 1</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>delivery_2</source>
        <translation>鞘管 2</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>total</source>
        <translation>合计</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>prepare</source>
        <translation>预处理</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>network</source>
        <translation>网络</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>masks</source>
        <translation>掩膜</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>skeletons</source>
        <translation>骨架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gaps</source>
        <translation>断点修复</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>graph</source>
        <translation>图结构</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>path</source>
        <translation>路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose</source>
        <translation>位姿</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>sensitivity</source>
        <translation>灵敏度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>it has no pixels</source>
        <translation>图像没有像素</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the network's output is not finite</source>
        <translation>网络输出含有非有限数值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no centerline beside the robot's head</source>
        <translation>机器人头端旁没有中心线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>it reaches the image border at its head, which may be out of view</source>
        <translation>机器人头端处到达图像边缘，头端可能已在画面之外</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>both of its ends lie at the image border, so its head may be out of view</source>
        <translation>机器人两端都在图像边缘，头端可能已在画面之外</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>it has no direction</source>
        <translation>没有方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the centerline beside the head has no direction</source>
        <translation>头端旁的中心线没有方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no vessel was found</source>
        <translation>没有找到血管</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no vessel that was found leads there</source>
        <translation>找到的血管都不通向那里</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>on the centerline and along it</source>
        <translation>在中心线上且方向一致</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>straight on</source>
        <translation>直行</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>at the target</source>
        <translation>已到目标</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>along the route</source>
        <translation>沿规划路线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a bend ahead</source>
        <translation>前方有弯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a bifurcation ahead</source>
        <translation>前方有分叉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the head must turn first</source>
        <translation>头端须先转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the target is near</source>
        <translation>目标已近</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the way seems to lie behind the head: looking again</source>
        <translation>去路似乎在头端后方：重新查看</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the way to the target branches off behind the head</source>
        <translation>通往目标的分支在头端后方</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the robot is fed but its head does not move</source>
        <translation>在推送机器人，但头端不动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no report yet</source>
        <translation>尚无报告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no frame yet</source>
        <translation>尚无图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no pose yet</source>
        <translation>尚无位姿</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>it shows something else</source>
        <translation>画面已变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>not checked yet</source>
        <translation>尚未检查</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servo process is not armed</source>
        <translation>舵机进程未待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no sign of life yet</source>
        <translation>尚无响应</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the rig stopped while it was armed</source>
        <translation>待命时装置停止了</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no frame behind the command</source>
        <translation>指令没有对应的图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>checking the servos</source>
        <translation>正在检查舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the torque is not proven to be off: cut the servos' power</source>
        <translation>未能证实力矩已关闭：请切断舵机电源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledging</source>
        <translation>正在确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>zeroing the servos</source>
        <translation>正在给舵机归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>switching the torque off</source>
        <translation>正在关闭力矩</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>stopped meanwhile: acknowledge, then switch the servos on again</source>
        <translation>其间已停止：请确认，再重新开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the torque was switched off meanwhile: switch the servos on again</source>
        <translation>期间力矩已关闭：请重新开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>S-curve</source>
        <translation>S 形弯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Y-branch</source>
        <translation>Y 形分叉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tree with five ends</source>
        <translation>五端血管树</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Aortic arch with supra-aortic vessels</source>
        <translation>带弓上分支的主动脉弓</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tortuous vessel</source>
        <translation>迂曲血管</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Carotid siphon</source>
        <translation>颈动脉虹吸段</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Three parallel channels</source>
        <translation>三条平行通道</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Loop of two ways</source>
        <translation>双路环</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Coronary tree with stenosis</source>
        <translation>带狭窄的冠状动脉树</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Clear bench</source>
        <translation>清晰台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Your bench's own picture</source>
        <translation>您的台架的实拍图</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Silicone on white</source>
        <translation>白底硅胶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Silicone on red</source>
        <translation>红底硅胶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Silicone on dark</source>
        <translation>深色底硅胶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Silicone on a coloured board</source>
        <translation>彩色底板硅胶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tinted liquid</source>
        <translation>有色液体</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Opaque channels</source>
        <translation>不透明通道</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Channels in a clear block</source>
        <translation>透明块中的通道</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Lit from behind</source>
        <translation>背光照明</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Fluoroscopy</source>
        <translation>透视成像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Subtraction angiography</source>
        <translation>减影血管造影</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Turbid gel</source>
        <translation>浑浊凝胶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Creased drape</source>
        <translation>有褶皱的铺巾</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Lamps of two colours</source>
        <translation>双色灯光</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Glowing liquid</source>
        <translation>发光液体</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tank of rippling water</source>
        <translation>水面波动的水槽</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Printed photograph</source>
        <translation>印刷照片</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>3D-printed resin</source>
        <translation>3D 打印树脂</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera</source>
        <translation>相机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>picture</source>
        <translation>图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>cores and memory</source>
        <translation>处理器与内存</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>recordings</source>
        <translation>录制</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>clock</source>
        <translation>时钟</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model</source>
        <translation>模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>self-test</source>
        <translation>自检</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>python</source>
        <translation>Python</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>cameras found</source>
        <translation>找到的相机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>see the camera; close other programs that use it (fuser -v /dev/video*)</source>
        <translation>见“相机”；关闭使用它的其他程序 (fuser -v /dev/video*)</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>packages</source>
        <translation>软件包</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>system libraries</source>
        <translation>系统库</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>display</source>
        <translation>显示</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo port</source>
        <translation>舵机端口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos</source>
        <translation>舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>adapter latency</source>
        <translation>适配器延迟</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>foot pedal</source>
        <translation>脚踏板</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gamepad</source>
        <translation>手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>not configured</source>
        <translation>未配置</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the rig has servos, but no port</source>
        <translation>台架有舵机，但没有设置端口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the bench twin needs none</source>
        <translation>数字孪生台架不需要</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>only real cameras are tried</source>
        <translation>只检查真实相机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no RealSense camera</source>
        <translation>没有 RealSense 相机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no webcam</source>
        <translation>没有网络摄像头</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug it into a USB 3 port; if it is: another cable, or another port</source>
        <translation>插入 USB 3 端口；若已插入：换一根线或换一个端口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug it in; if it is: another cable, or another port</source>
        <translation>请插入；若已插入：换一根线或换一个端口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug it in, or set camera.device</source>
        <translation>请插入，或设置 camera.device</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the cable; another USB port, without a hub</source>
        <translation>检查线缆；换一个 USB 端口，不经集线器</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>lens cap, lamp, focus; or set camera.exposure_ms</source>
        <translation>检查镜头盖、灯、对焦；或设置 camera.exposure_ms</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>release STOP; check its wire</source>
        <translation>松开停止按钮；检查其接线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>release the E-stop; check the wire of its second contact</source>
        <translation>松开急停；检查其第二触点的导线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check its USB cable</source>
        <translation>检查其 USB 线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the pedal's power and firmware, then plug it in again</source>
        <translation>检查脚踏板的电源和固件，然后重新插入</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>set record.folder to one that can be written</source>
        <translation>把 record.folder 设为可写的文件夹</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the disk, or set record.folder</source>
        <translation>检查磁盘，或设置 record.folder</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>restore the model folder, or set perception.segmentation.model to another one</source>
        <translation>恢复模型文件夹，或把 perception.segmentation.model 设为另一个模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>train it with the twin's frames too, or choose another model</source>
        <translation>训练时也加入数字孪生的图像，或选择另一个模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug the USB adapter in, or set servos.port (ls /dev/serial/by-id)</source>
        <translation>插入 USB 适配器，或设置 servos.port（ls /dev/serial/by-id）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>unplug the USB adapter and plug it in again</source>
        <translation>拔下 USB 适配器再重新插入</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>see the servo port</source>
        <translation>见“舵机端口”</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>switch the servos' supply on, check cables, servos.baud and the joints' ids</source>
        <translation>接通舵机电源，检查线缆、servos.baud 和关节的 id</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>find the reason (jam, heat, supply), then restart that servo in the servo table</source>
        <translation>找出原因（卡住、过热、供电），然后在舵机表中重启该舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bench twin (no hardware)</source>
        <translation>数字孪生台架（无硬件）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pulls the head to the right</source>
        <translation>把头端拉向右</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pulls the head to the left</source>
        <translation>把头端拉向左</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pulls the head out of the picture's plane</source>
        <translation>把头端拉出图像平面</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>feeds the robot</source>
        <translation>推送机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>feeds the catheter</source>
        <translation>推送鞘管</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>seen by eye</source>
        <translation>目测</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>up and down are assumed by the order of their ids: one camera cannot tell them apart; swap them if it is wrong</source>
        <translation>上下按 id 的顺序假定：一台相机分不清；若不对请交换</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>zero and steering were found with the servos in other places: find them anew</source>
        <translation>零位和转向是在舵机对应关系不同时找到的：请重新查找</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>every servo must have one name, and every name one servo</source>
        <translation>每个舵机必须有一个名称，每个名称对应一个舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the robot's head is not seen: move the robot until all of its last centimetres are in the picture</source>
        <translation>看不到机器人头端：移动机器人，直到其末端几厘米全部在图像中</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>too little of the robot is seen: feed it farther into the vessel</source>
        <translation>看到的机器人太短：把它向血管内再推送一些</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the robot's end has no direction: feed it farther into the vessel</source>
        <translation>机器人末端没有方向：把它向血管内再推送一些</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the head does not follow the wire: is it hung in, does the head lie free? Or zero it by eye</source>
        <translation>头端不跟随驱动丝：丝挂好了吗，头端能自由活动吗？或者目测归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a step was stopped half way and the wires are where it left them: find the zeros anew</source>
        <translation>有一步中途停止，驱动丝停在当时的位置：请重新寻找零位</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the board is still in the picture: take it away, then go on</source>
        <translation>标定板仍在画面中：请移开标定板，然后继续</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take the board away: the servos move when it is out of sight</source>
        <translation>请移开标定板：看不到标定板后舵机才会动作</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the head does not follow the wire's pull: pull it by hand, or zero it by eye</source>
        <translation>头端不跟随驱动丝的牵拉：用手拉，或者目测归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the wire was taut before it was pulled: loosen it, then try again, or zero it by eye</source>
        <translation>驱动丝在拉动之前已经绷紧：请先放松，然后重试，或目测归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>board</source>
        <translation>标定板</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>two clicks</source>
        <translation>两点单击</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>draw the robot, from its tail to its head</source>
        <translation>请从尾端到头端画出机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>draw the vessel's centerline beside the head</source>
        <translation>请在头端旁画出血管中心线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the vessel line ends too soon beside the head: draw it farther</source>
        <translation>血管线在头端旁过早结束：请再画远一些</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no answer</source>
        <translation>无应答</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the robot is not connected: connect it first</source>
        <translation>机器人未连接：请先连接</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servo bus process does not listen: connect the robot again</source>
        <translation>舵机总线进程没有响应：请重新连接机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no RealSense camera: plug it into a USB 3 port; main.py doctor --rig realsense says more</source>
        <translation>没有 RealSense 相机：请插入 USB 3 端口；main.py doctor --rig realsense 有更多说明</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no webcam: plug it in; main.py doctor --rig webcam says more</source>
        <translation>没有网络摄像头：请插入；main.py doctor --rig webcam 有更多说明</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no pedal is configured: set pedal.port to its path in /dev/serial/by-id</source>
        <translation>未配置脚踏板：请把 pedal.port 设为 /dev/serial/by-id 中的路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the bench twin has not told anything yet</source>
        <translation>数字孪生台架尚无消息</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the bench twin did not start: free memory, then start the rig again (F5)</source>
        <translation>数字孪生台架没有启动：请释放内存，再重新启动装置 (F5)</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>put in a point</source>
        <translation>插入点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>move a point</source>
        <translation>移动点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take out a point</source>
        <translation>删除点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nudge a point</source>
        <translation>微移点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>add a point</source>
        <translation>添加点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>can tell</source>
        <translation>可以判断</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>there is a robot</source>
        <translation>有机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take the algorithm's lines</source>
        <translation>采用算法的线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nothing to save: no frames in memory yet</source>
        <translation>没有可保存的内容：内存中还没有帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the last seconds are still being saved</source>
        <translation>最近几秒仍在保存中</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>relaxing the wires</source>
        <translation>正在放松拉线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the tension is being let off: wait a moment, then try again</source>
        <translation>正在卸除张力：请稍候，然后重试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>stopped meanwhile: the wires are as they were then</source>
        <translation>期间已停止：拉线维持当时的状态</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the wires were not let go in time: cut the servos' power</source>
        <translation>拉线未能及时放松：请切断舵机电源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servo port is not open: switch the torque off</source>
        <translation>舵机端口未打开：请断开扭矩</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the application ended meanwhile: nothing was switched on</source>
        <translation>期间程序已结束：未开启任何舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the twin's servos did not answer in time: close other programs, then try again; F5 starts the twin again</source>
        <translation>数字孪生的舵机未及时应答：请关闭其他程序，然后重试；F5 重新启动数字孪生</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bus speed</source>
        <translation>总线速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>adapter power</source>
        <translation>适配器供电</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>screen lock</source>
        <translation>屏幕锁定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>inhibited while the servos follow</source>
        <translation>舵机跟随期间已禁止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>switch screen lock and sleep off in the desktop's settings</source>
        <translation>请在桌面设置中关闭屏幕锁定和休眠</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>sleep cannot be inhibited: systemd-inhibit is not there</source>
        <translation>无法禁止休眠：没有 systemd-inhibit</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the computer is too busy; close other programs, and rehearse again</source>
        <translation>计算机太忙；请关闭其他程序后重新预演</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>with DYNAMIXEL Wizard 2.0 set Baud Rate (8) of all seven to 1 Mbps, then servos.baud = 1000000</source>
        <translation>用 DYNAMIXEL Wizard 2.0 将全部七个的 Baud Rate (8) 设为 1 Mbps，然后 servos.baud = 1000000</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>images</source>
        <translation>图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>images looked at</source>
        <translation>已查看的图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>rows</source>
        <translation>行</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: cut short: {a} of {b} pictures</source>
        <translation>{path}：视频不完整：{b} 帧中只有 {a} 帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: cut short: {a} of {b} s</source>
        <translation>{path}：视频不完整：{b} 秒中只有 {a} 秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: damaged after frame {a} ({why}), and not read on</source>
        <translation>{path}：第 {a} 帧之后损坏（{why}），未继续读取</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: damaged before its first frame ({why}), and not read on</source>
        <translation>{path}：第一帧之前已损坏（{why}），未继续读取</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest vessel probability {a}, but only in specks</source>
        <translation>血管概率最高 {a}，但只是零星斑点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest robot probability {a}, but only in specks; it does not know such pictures: {why}</source>
        <translation>机器人最高概率 {a}，但只是零星斑点；模型不认识这类图像：{why}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest robot probability {a}; it does not know such pictures: {why}</source>
        <translation>机器人最高概率 {a}；模型不认识这类图像：{why}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest robot probability {a}, but only in specks</source>
        <translation>机器人概率最高 {a}，但只是零星斑点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest vessel probability {a}</source>
        <translation>血管概率最高 {a}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>highest robot probability {a}</source>
        <translation>机器人概率最高 {a}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what looks like it covers {a} % of the image (at most {b} %); it does not know such pictures: {why}</source>
        <translation>疑似部分占图像的 {a} %（最多 {b} %）；模型不认识这类图像：{why}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what looks like one has walls beside the head that are blurred over {a} px (at most {b} px)</source>
        <translation>看似血管之物在头部旁的管壁模糊宽度为 {a} px（至多 {b} px）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the robot cannot go back any farther: take over, or choose another target</source>
        <translation>机器人无法再后退：请接管，或另选目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>newest frame {a} ms old</source>
        <translation>最新一帧已过 {a} ms</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{a} ms old</source>
        <translation>已过 {a} ms</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{a} ms (at most {b} ms)</source>
        <translation>{a} ms（最多 {b} ms）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>outside its envelope: {where}: switch the torque off and move it back by hand, or zero it again</source>
        <translation>超出行程范围：{where}：请关闭力矩后用手移回，或重新归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{engine}, first frame in {a} ms: state {state} (true {truth}), theta off by {b} deg, head by {c} px</source>
        <translation>{engine}，首帧 {a} ms：状态 {state}（真值 {truth}），θ 相差 {b}°，头端相差 {c} px</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>not configured; none is plugged in</source>
        <translation>未配置；也没有插入</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{a} cores, {b} GB of memory, {c} GB free</source>
        <translation>{a} 个核心，内存 {b} GB，空闲 {c} GB</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{a} core, {b} GB of memory, {c} GB free</source>
        <translation>{a} 个核心，内存 {b} GB，空闲 {c} GB</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{what}; {a} V at least, {b} °C at most, torque off</source>
        <translation>{what}；最低 {a} V，最高 {b} °C，力矩已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{port} reports; deadman released</source>
        <translation>{port} 有报告；使能键已松开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{port} reports; deadman pressed</source>
        <translation>{port} 有报告；使能键已按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{names} can be loaded</source>
        <translation>{names} 可以加载</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{joint}: taut {a} mm farther</source>
        <translation>{joint}：再拉 {a} mm 绷直</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{joint}: taut {a} mm back</source>
        <translation>{joint}：退回 {a} mm 绷直</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servo bus process cannot be started ({why}): free memory, then try again</source>
        <translation>无法启动舵机总线进程（{why}）：请释放内存后重试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the pedal at {port} is silent: check its power and firmware, then plug it in again</source>
        <translation>脚踏板 {port} 没有响应：检查其电源和固件，然后重新插入</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what comes from {port} is no pedal's report: check pedal.baud, the cable, and that it is the pedal</source>
        <translation>{port} 传来的不是脚踏板的报告：检查 pedal.baud 和线缆，并确认它是脚踏板</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gamepad {path} is not there: plug it in, or leave gamepad.device out to take the first</source>
        <translation>手柄 {path} 不存在：插入手柄，或不设 gamepad.device 以使用第一个手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gamepad {path} cannot be opened: plug it in, or leave gamepad.device out to take the first</source>
        <translation>手柄 {path} 无法打开：插入手柄，或不设 gamepad.device 以使用第一个手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gamepad {name} is in use by another window, so its STOP does nothing here: close that window, or set gamepad.device</source>
        <translation>手柄 {name} 正被另一个窗口使用，因此它的停止键在此不起作用：关闭那个窗口，或设置 gamepad.device</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gamepad {name} cannot be locked ({why}), so its STOP does nothing here: unplug it and plug it in again</source>
        <translation>手柄 {name} 无法锁定（{why}），因此它的停止键在此不起作用：拔下后重新插上</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the bench twin cannot be started ({why}): free memory, then try again</source>
        <translation>无法启动数字孪生台架（{why}）：请释放内存后重试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>damaged answer</source>
        <translation>应答损坏</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a late answer may still come</source>
        <translation>迟到的应答仍可能到来</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no answer, behind two silent servos</source>
        <translation>无应答，排在两个无应答的舵机之后</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a rig's name has 1 to 60 letters, digits, or - _ . ( ) +, and begins with a letter or digit</source>
        <translation>台架名称由 1 至 60 个字母、数字或 - _ . ( ) + 组成，并以字母或数字开头</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: {key}: {why}; the default is used</source>
        <translation>{path}：{key}：{why}；使用默认值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>draw {what} mask</source>
        <translation>绘制{what}掩膜</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>simplify {what} mask</source>
        <translation>简化{what}掩膜</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>clear the {what}</source>
        <translation>清除{what}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take the algorithm's {what} mask</source>
        <translation>采用算法的{what}掩膜</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: has no video in it</source>
        <translation>{path}：其中没有视频</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: has a video of a kind that cannot be decoded here</source>
        <translation>{path}：其中的视频格式在此无法解码</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{path}: {key}: unknown key, kept but not used</source>
        <translation>{path}：{key}：未知的键，保留但不使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>above {a} and at most {rest}</source>
        <translation>大于 {a} 且不超过 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>above {a} and below {rest}</source>
        <translation>大于 {a} 且小于 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>at least {a} and below {rest}</source>
        <translation>不小于 {a} 且小于 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>{a} to {end}, a multiple of {rest}</source>
        <translation>{a} 至 {end}，{rest} 的倍数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>at least {rest}</source>
        <translation>至少 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>above {rest}</source>
        <translation>大于 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>at most {rest}</source>
        <translation>至多 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>below {rest}</source>
        <translation>小于 {rest}</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>it did not end properly: session recover {path} saves what can be had</source>
        <translation>它未正常结束：session recover {path} 可挽救能得到的部分</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>frames of {name}</source>
        <translation>{name} 的帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>unreadable image</source>
        <translation>图像无法读取</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no model</source>
        <translation>没有模型</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>image black</source>
        <translation>图像全黑</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>image overexposed</source>
        <translation>图像过曝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>image blurred</source>
        <translation>图像模糊</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no vessel</source>
        <translation>没有血管</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>several robots</source>
        <translation>多个机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot too short</source>
        <translation>机器人太短</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot outside vessel</source>
        <translation>机器人在血管外</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>repaired gap too long</source>
        <translation>修复的断点过长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot path ambiguous</source>
        <translation>机器人路径不明确</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ambiguous branch</source>
        <translation>分支不明确</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>low confidence</source>
        <translation>置信度低</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>unlike the training data</source>
        <translation>与训练数据不同</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>head jumped</source>
        <translation>头端跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera or phantom moved</source>
        <translation>相机或体模被移动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>not this bench</source>
        <translation>不是此台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>stop pressed</source>
        <translation>已按停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>e-stop pressed</source>
        <translation>急停已按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo port lost</source>
        <translation>舵机端口断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo reports a hardware error</source>
        <translation>舵机报告硬件错误</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo does not follow</source>
        <translation>舵机不跟随</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo draws too much current</source>
        <translation>舵机电流过大</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>torque not proven to be off</source>
        <translation>未能证实力矩已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos are not as configured</source>
        <translation>舵机与配置不符</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>clock jumped</source>
        <translation>时钟跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bad packets on the servo bus</source>
        <translation>舵机总线有坏包</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo power lost</source>
        <translation>舵机断电</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo silent</source>
        <translation>舵机无应答</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo bus lost</source>
        <translation>舵机总线断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo restarted</source>
        <translation>舵机重启</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>torque switched off by another program</source>
        <translation>扭矩被另一程序断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bus watchdog tripped</source>
        <translation>总线看门狗触发</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo too hot</source>
        <translation>舵机过热</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>supply voltage too low</source>
        <translation>供电电压过低</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>window hangs</source>
        <translation>窗口无响应</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>worker stopped</source>
        <translation>感知线程停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera lost</source>
        <translation>相机断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera frozen</source>
        <translation>相机画面冻结</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wrong picture format</source>
        <translation>图像格式不对</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera moved</source>
        <translation>相机被移动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>too many frames lost for long</source>
        <translation>长时间丢帧过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model unfit</source>
        <translation>模型不可用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>several robots in view</source>
        <translation>视野中有多个机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot outside the vessel</source>
        <translation>机器人在血管外</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>results not finite again and again</source>
        <translation>结果反复为非有限数值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>commands rejected again and again</source>
        <translation>指令反复被拒绝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>head turns against the command</source>
        <translation>头端转向与命令相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot moves against the feed</source>
        <translation>机器人移动与进给相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>head lost for long</source>
        <translation>头端长时间丢失</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose lost</source>
        <translation>位姿丢失</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo bus silent</source>
        <translation>舵机总线无响应</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no new frame</source>
        <translation>没有新图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>picture black</source>
        <translation>图像全黑</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>picture overexposed</source>
        <translation>图像过曝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>too many frames lost</source>
        <translation>丢帧过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>result not finite</source>
        <translation>结果为非有限数值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>command rejected</source>
        <translation>指令被拒绝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>head lost</source>
        <translation>头端丢失</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose jumped</source>
        <translation>位姿跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>two branches fit</source>
        <translation>两条分支都符合</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>robot or vessel not clear</source>
        <translation>机器人或血管不清楚</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>confidence too low</source>
        <translation>置信度过低</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>picture of an unknown kind</source>
        <translation>未知类型的图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose stale</source>
        <translation>位姿过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no way to a destination</source>
        <translation>没有通往目标点的路</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>deadman released</source>
        <translation>使能键松开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>frames dropped</source>
        <translation>丢帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pictures out of order</source>
        <translation>图像顺序错乱</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servo getting hot</source>
        <translation>舵机温度升高</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>supply voltage sags</source>
        <translation>供电电压下降</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>disk nearly full</source>
        <translation>磁盘快满</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>disk full</source>
        <translation>磁盘已满</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>recording stopped</source>
        <translation>录制已停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>recorder drops frames</source>
        <translation>录制器丢帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>fault not acknowledged</source>
        <translation>故障未确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>already armed</source>
        <translation>已经待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera not well for long enough</source>
        <translation>相机正常的时间还不够长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>perception not well for long enough</source>
        <translation>感知正常的时间还不够长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos not checked</source>
        <translation>舵机未检查</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos busy</source>
        <translation>舵机忙</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>arm first</source>
        <translation>请先进入待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>already handed over</source>
        <translation>已经移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no destination chosen</source>
        <translation>未选择目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>destination behind the robot</source>
        <translation>目标点在机器人后方</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>deadman not held</source>
        <translation>未按住使能键</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>deadman was down before arming</source>
        <translation>待命前使能键已按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>deadman on the keyboard only</source>
        <translation>只有键盘作为使能键</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>controls in use</source>
        <translation>操纵键正在使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>drive cannot limit its force</source>
        <translation>驱动器无法限制其力</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>drums not measured</source>
        <translation>未测量绕线轮</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>directions of the servos not learned</source>
        <translation>未学习舵机方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>up and down assumed</source>
        <translation>上下为假定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>steering not learned</source>
        <translation>未学习转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>right and left act the wrong way</source>
        <translation>左右动作相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model not calibrated</source>
        <translation>模型未校准</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model not taught on this bench</source>
        <translation>模型未在此台架上学习</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>checks of perception switched off</source>
        <translation>感知检查已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>policy does not look at the picture</source>
        <translation>策略不看图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>rig not accepted</source>
        <translation>装置未验收</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>rig changed since it was accepted</source>
        <translation>装置在验收后有更改</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no target</source>
        <translation>没有目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>target behind the robot</source>
        <translation>目标点在机器人后方</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ready</source>
        <translation>就绪</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>number not finite</source>
        <translation>数值非有限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wrong number of joints</source>
        <translation>关节数不对</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>time in the future</source>
        <translation>时间在未来</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>clock went back</source>
        <translation>时钟倒退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>clock jumped ahead</source>
        <translation>时钟向前跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>not armed</source>
        <translation>未待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>somebody else drives</source>
        <translation>由他方驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no command</source>
        <translation>没有指令</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>command too old</source>
        <translation>指令过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>command overtaken by a newer one</source>
        <translation>指令被更新的超越</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose behind the command too old</source>
        <translation>指令所依据的位姿过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>positions unknown</source>
        <translation>位置未知</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>positions too old</source>
        <translation>位置过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>joint is outside its envelope</source>
        <translation>关节超出行程范围</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>goal outside the envelope</source>
        <translation>目标超出行程范围</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>goal too far away</source>
        <translation>目标过远</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>joint is not where it was sent</source>
        <translation>关节不在指令位置</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bumpless start</source>
        <translation>无扰起步</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>end of the envelope</source>
        <translation>行程终点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>near the end of the envelope</source>
        <translation>接近行程终点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>speed</source>
        <translation>速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acceleration</source>
        <translation>加速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>step from the measured position</source>
        <translation>与实测位置的步长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the other servo of the same catheter</source>
        <translation>同一导管的另一个舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acts at once</source>
        <translation>立即生效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>from the next start of the rig</source>
        <translation>装置下次启动起生效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>from the next start of the program</source>
        <translation>程序下次启动起生效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>STOP pressed</source>
        <translation>已按停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge, check the servos, arm again; an emergency needs the power cut</source>
        <translation>确认，检查舵机，重新待命；紧急情况须切断电源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge, switch the servos on, arm again</source>
        <translation>确认，开启舵机，重新就绪</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>E-stop pressed</source>
        <translation>急停已按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>release the E-stop, acknowledge, then zero the servos and arm again</source>
        <translation>松开急停，确认，然后为舵机设零并重新就绪</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Servo port lost</source>
        <translation>舵机端口断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug the servo cable in, check the servos, then acknowledge</source>
        <translation>插好舵机线缆，检查舵机，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the twin has failed: F5 starts it again, then acknowledge</source>
        <translation>数字孪生出错：F5 重新启动，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo reports a hardware error</source>
        <translation>有舵机报告硬件错误</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>free the wire, restart the servo, acknowledge, then zero it</source>
        <translation>松开驱动丝，重启舵机，确认，然后归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo does not follow: jam or slack wire</source>
        <translation>有舵机不跟随：卡住或驱动丝松弛</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>look for a jam or a slack wire, then acknowledge</source>
        <translation>查找卡住处或松弛的驱动丝，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo draws too much current</source>
        <translation>有舵机电流过大</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>free what blocks, let it cool, then acknowledge</source>
        <translation>排除卡阻,让它冷却,然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The torque is not proven to be off</source>
        <translation>未能证实力矩已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>cut the servos' power; until they say so it is tried again</source>
        <translation>请切断舵机电源；在舵机证实之前会反复尝试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Servos are not as configured</source>
        <translation>舵机与配置不符</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>compare ids, model and mode with the configuration</source>
        <translation>将 id、型号和模式与配置核对</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The clock jumped or the computer slept</source>
        <translation>时钟跳变或计算机休眠过</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the robot, acknowledge, arm again</source>
        <translation>检查机器人，确认，重新待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Too many bad packets from the servos</source>
        <translation>舵机坏包过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check plugs and shielding of the servo cable, then acknowledge</source>
        <translation>检查舵机线缆的插头和屏蔽，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No servo power: E-stop pressed, or supply off</source>
        <translation>舵机无电源：急停已按下或电源关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>release the E-stop or switch the supply on; acknowledge, zero</source>
        <translation>松开急停或接通电源；确认，设零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo does not answer</source>
        <translation>有舵机没有应答</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check its cable and power, then acknowledge</source>
        <translation>检查其线缆和电源，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Nothing heard from the servo bus</source>
        <translation>舵机总线没有消息</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge, then switch the servos on: that starts it again</source>
        <translation>确认，然后开启舵机：总线会随之重新启动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo restarted and lost its zero</source>
        <translation>有舵机重启并丢失零位</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge, then zero the servos again</source>
        <translation>确认，然后将舵机重新归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Another program switched the torque off</source>
        <translation>另一程序断开了扭矩</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>end that program (doctor names it), check the wires, then acknowledge</source>
        <translation>结束该程序（doctor 会指出），检查拉线，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' watchdog tripped</source>
        <translation>舵机看门狗触发</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the servos, then acknowledge</source>
        <translation>检查舵机，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo is too hot</source>
        <translation>有舵机过热</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>let it cool, lower the pretension, then acknowledge</source>
        <translation>让它冷却,降低预紧力,然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' supply voltage is too low</source>
        <translation>舵机供电电压过低</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the power supply, then acknowledge</source>
        <translation>检查电源，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The window does not answer</source>
        <translation>窗口没有响应</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge when it answers again; restart it if it does not</source>
        <translation>恢复响应后确认；若不恢复请重新启动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The perception worker stopped</source>
        <translation>感知线程停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>start again with F5, then acknowledge</source>
        <translation>按 F5 重新启动，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Camera lost</source>
        <translation>相机断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>plug the camera in and start again, then acknowledge</source>
        <translation>插好相机并重新启动，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The camera gives the same picture</source>
        <translation>相机一直给出同一幅图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>start the camera again, then acknowledge</source>
        <translation>重新启动相机，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The camera's picture has the wrong format</source>
        <translation>相机图像格式不对</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>set the camera's size and colour format, then acknowledge</source>
        <translation>设置相机的尺寸和颜色格式，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The camera was moved</source>
        <translation>相机被移动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>put it back, or calibrate the rig and make its bench again (without: F5); acknowledge</source>
        <translation>放回原位，或重新标定装置并重新建立其台架（没有装置：F5）；确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Too many camera frames lost</source>
        <translation>相机丢帧过多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the USB port and cable, then acknowledge</source>
        <translation>检查 USB 端口和线缆，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the twin is behind: close other programs; if it stays, F5 starts it again; then acknowledge</source>
        <translation>数字孪生落后：请关闭其他程序；若仍如此，F5 重新启动；然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The model is missing or damaged</source>
        <translation>模型缺失或损坏</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>put the model back or choose another one in the configuration</source>
        <translation>恢复模型，或在配置中选择另一个</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>leave one robot in the picture, then acknowledge</source>
        <translation>图像中只留一个机器人，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The robot seems outside the vessel</source>
        <translation>机器人似乎在血管之外</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>look at the phantom; retract by hand, then acknowledge</source>
        <translation>查看体模；手动后退，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Perception gave broken results</source>
        <translation>感知给出错误结果</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The program's commands were rejected</source>
        <translation>程序的指令被拒绝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge; if it comes again, report it with the log</source>
        <translation>确认；若再次出现，请连同日志报告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The head turns the other way than it is steered</source>
        <translation>头端转向与操控方向相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the tendons; Rig, Calibrate: Wiggle, Steering; acknowledge</source>
        <translation>检查拉线；“装置”，标定：摆动、转向；确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The robot moves the other way than it is fed</source>
        <translation>机器人移动方向与进给相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the feed's direction; Rig, Calibrate: Wiggle; acknowledge</source>
        <translation>检查进给方向；“装置”，标定：摆动；确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The robot's head is lost</source>
        <translation>机器人头端丢失</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bring the robot back into view by hand, then acknowledge</source>
        <translation>手动使机器人回到视野，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No pose for half a second</source>
        <translation>半秒内没有位姿</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait for a pose or drive by hand, then acknowledge</source>
        <translation>等待位姿或手动驾驶，然后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servo bus is silent</source>
        <translation>舵机总线无响应</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait a moment; if it stays, check the cable</source>
        <translation>稍等；若不恢复，检查线缆</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the twin is behind: close other programs; if it stays, F5 starts it again</source>
        <translation>数字孪生落后：请关闭其他程序；若仍如此，F5 重新启动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No new picture from the camera</source>
        <translation>相机没有新图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The picture is black</source>
        <translation>图像全黑</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take the lens cap off or switch the lamp on</source>
        <translation>取下镜头盖或打开灯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The picture is overexposed</source>
        <translation>图像过曝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Many camera frames are lost</source>
        <translation>相机丢帧较多</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the USB port and cable</source>
        <translation>检查 USB 端口和线缆</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Perception gave a broken result</source>
        <translation>感知给出一次错误结果</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait for the next picture</source>
        <translation>等待下一幅图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The gate rejected a command</source>
        <translation>安全闸拒绝了一条指令</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait a moment, or drive by hand</source>
        <translation>稍等，或手动驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The robot's head is out of sight</source>
        <translation>看不到机器人头端</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bring the robot back into view by hand</source>
        <translation>手动使机器人回到视野</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The head jumped in the picture</source>
        <translation>头端在图像中跳变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait for the next pictures</source>
        <translation>等待接下来的图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Robot or vessel not clearly seen</source>
        <translation>机器人或血管看不清</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>improve light and focus, remove what covers them</source>
        <translation>改善光照和对焦，移开遮挡物</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Perception is not sure enough</source>
        <translation>感知把握不足</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>improve light and focus, or drive by hand</source>
        <translation>改善光照和对焦，或手动驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The picture is of an unknown kind</source>
        <translation>图像属于未知类型</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>teach the model pictures of this rig, or drive by hand</source>
        <translation>用本装置的图像训练模型，或手动驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The pose is too old</source>
        <translation>位姿过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>wait a moment; close other programs if it stays</source>
        <translation>稍等；若不恢复，关闭其他程序</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No way to a target</source>
        <translation>没有通往目标点的路</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>click a target ahead of the robot</source>
        <translation>单击机器人前方的目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Deadman released</source>
        <translation>使能键已松开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>press it again at once, or hand over again</source>
        <translation>立即重新按下，或重新移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The camera drops frames</source>
        <translation>相机丢帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The camera's pictures come out of order</source>
        <translation>相机图像顺序错乱</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nothing to do: late ones are left out; check the driver</source>
        <translation>无须处理：迟到的已略去；检查驱动程序</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A servo is getting hot</source>
        <translation>有舵机温度升高</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pause soon and let it cool</source>
        <translation>尽快暂停，让其冷却</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' supply voltage sags</source>
        <translation>舵机供电电压下降</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the power supply</source>
        <translation>检查电源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The disk is nearly full</source>
        <translation>磁盘快满了</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>make room or end the recording</source>
        <translation>腾出空间或结束录制</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Disk full: recording stopped</source>
        <translation>磁盘已满：录制停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>make room and record again; driving goes on</source>
        <translation>腾出空间后重新录制；驾驶继续</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The recording stopped</source>
        <translation>录制已停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>do what it says and record again; driving goes on</source>
        <translation>按提示处理后重新录制；驱动继续</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The recorder drops frames</source>
        <translation>录制器丢帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>close other programs or record at a lower rate</source>
        <translation>关闭其他程序或降低录制帧率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Target reached</source>
        <translation>已到达目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>you drive again: choose the next one, or go on by hand</source>
        <translation>由您驾驶：选择下一个目标，或手动继续</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Another target: you drive again</source>
        <translation>目标已换：由您驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>hand over again to go there</source>
        <translation>重新移交以前往</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The torque is off: all servos have said so</source>
        <translation>力矩已关闭：所有舵机均已证实</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the wires hang loose; switch the servos on to drive</source>
        <translation>驱动丝已松弛；驾驶前请开启舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The wires were let out slowly</source>
        <translation>拉线已缓慢放松</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>find the cause before you pull them again</source>
        <translation>再次拉紧之前先查明原因</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Wires may still be tight</source>
        <translation>拉线可能仍然绷紧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>look at them; let them go by Torque off (page Servos)</source>
        <translation>请检查;用“断开扭矩”(舵机页)放松它们</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A joint is at the end of its travel</source>
        <translation>有关节到达行程末端</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>drive the other way</source>
        <translation>向反方向驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A feed is at the end of its way back</source>
        <translation>进给已到退回的尽头</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>to pull it out further, slowly: let go, then hold retract again</source>
        <translation>要继续缓慢拉出：松开，再按住后退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pulling out beyond the end: slow, while held</source>
        <translation>正在拉出到尽头之外：缓慢，按住期间</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>watch the robot; when it is out, say where it is (page Servos, Zero)</source>
        <translation>看着机器人；拉出后，说明其位置（“舵机”页，零点）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge the stop first</source>
        <translation>请先确认停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A fault is not acknowledged</source>
        <translation>有故障未确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>read it and acknowledge it</source>
        <translation>阅读后确认</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Armed</source>
        <translation>已待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>hand over to a target; disarm first for anything else</source>
        <translation>移交到某个目标点；其他操作请先解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Waiting for steady pictures (1 s)</source>
        <translation>等待稳定的图像（1 秒）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the camera must be well for a second</source>
        <translation>相机须连续正常一秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Waiting for a steady pose (1 s)</source>
        <translation>等待稳定的位姿（1 秒）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>keep the robot in view: it must be seen well for a second</source>
        <translation>保持机器人在视野内：须清晰可见一秒</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos are not in use</source>
        <translation>舵机未使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>switch them on; that checks them, too</source>
        <translation>请开启；开启时会一并检查</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos are busy</source>
        <translation>舵机正忙</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ask again when that has ended</source>
        <translation>请在其结束后再试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Not armed</source>
        <translation>未待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Already handed over</source>
        <translation>已经移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>touch the controls to take back</source>
        <translation>动一下操纵键即可收回</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No target chosen</source>
        <translation>未选择目标点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The target is behind the robot</source>
        <translation>目标点在机器人后方</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>choose one ahead, or retract by hand first</source>
        <translation>选择前方的目标点，或先手动后退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The deadman is not held</source>
        <translation>未按住使能键</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>press and hold it (let it go first if it is down), then hand over</source>
        <translation>按住它（若已按下请先松开），然后移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The deadman was down before arming</source>
        <translation>待命前使能键已按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>let it go and press it again</source>
        <translation>松开后重新按下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The keyboard alone is no deadman here</source>
        <translation>此处不能只用键盘作为使能键</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>hold the pedal, or set keyboard_deadman = true in the rig's file, then F5</source>
        <translation>按住脚踏，或在装置文件中设 keyboard_deadman = true，然后按 F5</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The controls are in use</source>
        <translation>操纵键正在使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>let go of the controls, then hand over</source>
        <translation>松开操纵键，然后移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' drums are not measured</source>
        <translation>舵机的绕线轮尚未测量</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Rig, Calibrate: page Drums; until then ways and forces are assumed</source>
        <translation>“装置”菜单，标定：“绕线轮”页；在此之前行程和力为假定值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The drive cannot limit its force</source>
        <translation>驱动器无法限制其力</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>by hand you can drive; the program needs other servos</source>
        <translation>可以手动驱动;由程序驱动需要其他舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' directions are not learned</source>
        <translation>尚未学习舵机方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Rig, Calibrate: page Wiggle and direction; by hand you can drive</source>
        <translation>“装置”菜单，标定：“摆动与方向”页；可手动驱动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Up and down are assumed</source>
        <translation>上下为假定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Rig, Calibrate: look, and confirm or swap them on the page Wiggle and direction</source>
        <translation>“装置”菜单，标定：在“摆动与方向”页查看并确认或交换</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The steering is not learned</source>
        <translation>尚未学习转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Rig, Calibrate: page Steering; by hand you can drive</source>
        <translation>“装置”菜单，标定：“转向”页；可手动驱动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Right and left act the wrong way</source>
        <translation>左右动作相反</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Rig, Calibrate: wiggle again, or turn the robot in its holder; then Steering</source>
        <translation>“装置”菜单，标定：重新摆动，或在支架中转动机器人；然后“转向”</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The model's confidence is not calibrated</source>
        <translation>模型的置信度未校准</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Model, Teach this bench; or main.py teach, or calibrate</source>
        <translation>“模型”菜单，学习此台架；或 main.py teach 或 calibrate</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The model was not taught on this bench</source>
        <translation>模型未在此台架上学习</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>menu Model, Teach this bench; or main.py teach</source>
        <translation>“模型”菜单，学习此台架；或 main.py teach</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Checks of perception are switched off</source>
        <translation>感知检查已关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>set perception.quality.enabled, and max_novelty to 1.25 at most</source>
        <translation>设置 perception.quality.enabled，且 max_novelty 不超过 1.25</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The policy does not look at the picture</source>
        <translation>策略不看图像</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>set policy.name to pursuit or table</source>
        <translation>将 policy.name 设为 pursuit 或 table</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The rig was not accepted</source>
        <translation>装置未验收</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>close it, then main.py rig accept NAME; by hand you can drive</source>
        <translation>关闭它，然后运行 main.py rig accept NAME；可手动驱动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The rig was changed since it was accepted</source>
        <translation>装置在验收后有更改</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>main.py rig show NAME says what; close it, then main.py rig accept NAME</source>
        <translation>main.py rig show NAME 说明更改；关闭它，然后 main.py rig accept NAME</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command is not a number</source>
        <translation>指令不是数值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nothing to do; report it if it comes again</source>
        <translation>无须处理；若再次出现请报告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command has the wrong number of joints</source>
        <translation>指令的关节数不对</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>report it with the log</source>
        <translation>请连同日志报告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command is from the future</source>
        <translation>指令来自未来</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>start the program again</source>
        <translation>重新启动程序</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The clock went back</source>
        <translation>时钟倒退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servo loop stood still</source>
        <translation>舵机循环停顿过</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>close other programs</source>
        <translation>关闭其他程序</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Nobody may drive now</source>
        <translation>现在无人可以驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>acknowledge faults, check the servos, arm</source>
        <translation>确认故障，检查舵机，进入待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Somebody else drives</source>
        <translation>正由他方驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>take back, or hand over</source>
        <translation>收回控制，或移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>No command</source>
        <translation>没有指令</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nothing to do</source>
        <translation>无须处理</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command came too late</source>
        <translation>指令来得太迟</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command was overtaken</source>
        <translation>指令已被超越</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command from too old a picture</source>
        <translation>指令所依据的图像过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' positions are unknown</source>
        <translation>舵机位置未知</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the servos</source>
        <translation>检查舵机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The servos' positions are too old</source>
        <translation>舵机位置过旧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>check the servo cable</source>
        <translation>检查舵机线缆</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A joint is outside its envelope</source>
        <translation>有关节超出行程范围</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>move it back by hand, or zero it again</source>
        <translation>手动移回，或重新归零</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Goal outside the envelope</source>
        <translation>目标超出行程范围</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Goal too far away</source>
        <translation>目标过远</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>report it if it comes again</source>
        <translation>若再次出现请报告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A joint was pushed off its course</source>
        <translation>有关节偏离其路线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>look for a jam; then drive on</source>
        <translation>查找卡住处；然后继续</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Rig</source>
        <translation>装置</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Which camera and robot are used.</source>
        <translation>使用哪个相机和机器人。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Name</source>
        <translation>名称</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what sessions and messages call this rig</source>
        <translation>会话和消息中此装置的名称</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>where pictures come from</source>
        <translation>图像的来源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what moves; servos = real ones, see section Servos</source>
        <translation>由什么来运动；servos = 真实舵机，见“舵机”一节</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Source</source>
        <translation>来源</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>path of the video or folder</source>
        <translation>视频或文件夹的路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>File</source>
        <translation>文件</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>rig file, made by the rig wizard, whose calibration is used; empty: not calibrated</source>
        <translation>装置向导生成的装置文件，使用其标定；留空：未标定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Camera (real)</source>
        <translation>相机（真实）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>A real camera. Where it has no such setting, what is asked for is left out, and ``doctor`` says so.</source>
        <translation>真实相机。相机没有的设置会略去，``doctor`` 会说明。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Serial</source>
        <translation>序列号</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>RealSense, Basler: its serial number; empty: the only one there is</source>
        <translation>RealSense、Basler：其序列号；空：唯一的那台</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Device</source>
        <translation>设备</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>webcam: its stable path in /dev/v4l/by-id, or its number; empty: the first one</source>
        <translation>网络摄像头：/dev/v4l/by-id 中的固定路径或编号；留空：第一台</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the pictures</source>
        <translation>图像的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frames per second</source>
        <translation>每秒帧数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>that the camera is asked for</source>
        <translation>向相机请求的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pixel format</source>
        <translation>像素格式</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>webcam: FOURCC; MJPG is what USB 2 has the room for</source>
        <translation>网络摄像头：FOURCC；USB 2 的带宽适合 MJPG</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Exposure</source>
        <translation>曝光</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>empty: automatic, but never at the cost of frames</source>
        <translation>留空：自动，但绝不以丢帧为代价</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gain</source>
        <translation>增益</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in the camera's own steps; empty: as it is</source>
        <translation>以相机自己的步长计；留空：保持原样</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>White balance</source>
        <translation>白平衡</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>colour temperature; empty: automatic</source>
        <translation>色温；留空：自动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Lost after</source>
        <translation>判为断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no frame for so long: the camera counts as lost</source>
        <translation>这么久没有图像，相机视为断开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Reconnect</source>
        <translation>重新连接</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pause between two attempts to open a lost camera</source>
        <translation>两次尝试打开已断开相机之间的间隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bench twin</source>
        <translation>数字孪生台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The bench twin: a simulated robot, phantom and camera.</source>
        <translation>数字孪生台架：仿真的机器人、体模和相机。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a named phantom, or random:&lt;seed&gt;</source>
        <translation>有名称的体模，或 random:&lt;seed&gt;</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Look</source>
        <translation>外观</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a family of looks, as in synth --family; empty: by appearance_seed</source>
        <translation>外观类别，同 synth --family；留空：由 appearance_seed 决定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Appearance seed</source>
        <translation>外观种子</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of light, board and camera noise; without a look, 0 = the clear bench</source>
        <translation>光照、底板和相机噪声的种子；未选外观时 0 = 清晰台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Image width</source>
        <translation>图像宽度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of its camera</source>
        <translation>其相机的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Image height</source>
        <translation>图像高度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in lock-step: trials, data sets</source>
        <translation>同步运行时：试验、数据集</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Live frames per second</source>
        <translation>实时每秒帧数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the running twin, which shares the computer</source>
        <translation>实时运行的孪生的帧率，它与程序共用计算机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Wiring</source>
        <translation>接线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ids of its servos in the order of the joints, minus: it turns the other way; empty: as servos.joints says</source>
        <translation>按关节顺序列出舵机 id，负号表示反向；留空：同 servos.joints</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Roll</source>
        <translation>滚转</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>turn of the robot about its axis; 0: right and left act in the picture</source>
        <translation>机器人绕自身轴的转角；0：左右作用在图像平面内</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Lens distortion</source>
        <translation>镜头畸变</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of its camera's lens; negative: barrel, 0: none</source>
        <translation>其相机镜头的畸变；负：桶形，0：无</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Perception</source>
        <translation>感知</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>From the picture to the pose.</source>
        <translation>从图像到位姿。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Working size</source>
        <translation>工作尺寸</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>longer side that all _px settings refer to</source>
        <translation>所有 _px 设置所依据的长边</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bench</source>
        <translation>台架</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>folder of the bench that the camera sees; empty: not known</source>
        <translation>相机所见台架的文件夹；空：未知</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Segmentation</source>
        <translation>分割</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The network and its thresholds.</source>
        <translation>网络及其阈值。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model folder in resources/models, or a path</source>
        <translation>resources/models 中的模型文件夹，或路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>inference engine</source>
        <translation>推理引擎</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Precision</source>
        <translation>精度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of OpenVINO; auto = int8 where the model has it</source>
        <translation>OpenVINO 的精度；auto = 模型有 int8 时用 int8</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Threads</source>
        <translation>线程数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>CPU threads; 0 = all cores</source>
        <translation>CPU 线程数；0 = 所有核心</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Mirrored</source>
        <translation>镜像平均</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>average over a picture's eight orientations: of single pictures, always, never</source>
        <translation>对图像的八种朝向（旋转与镜像）取平均：仅单张图片、总是、从不</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Second look</source>
        <translation>二次细看</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>look again, closely, at the robot's ends, where the model has a network for it</source>
        <translation>在机器人两端再细看一次（模型带有相应网络时）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Vessel threshold</source>
        <translation>血管阈值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>probability from which on a pixel is vessel</source>
        <translation>像素判为血管的最低概率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Robot threshold</source>
        <translation>机器人阈值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>probability from which on a pixel is robot</source>
        <translation>像素判为机器人的最低概率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Cleaning</source>
        <translation>清理</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Mask cleaning and thinning.</source>
        <translation>掩膜清理与细化。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min vessel area</source>
        <translation>最小血管面积</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>smaller pieces of vessel are dropped</source>
        <translation>更小的血管碎片被丢弃</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min robot area</source>
        <translation>最小机器人面积</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>smaller pieces of robot are dropped</source>
        <translation>更小的机器人碎片被丢弃</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max hole area</source>
        <translation>最大孔洞面积</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>holes up to this size are filled, in both masks</source>
        <translation>两个掩膜中不大于此的孔洞被填充</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Prune spurs</source>
        <translation>修剪毛刺</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>drop vessel spurs shorter than the local lumen radius</source>
        <translation>去除短于当地管腔半径的血管毛刺</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Extend ends</source>
        <translation>延长端点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>lead ends on as they run, to the edge of mask or image</source>
        <translation>把端点顺着走向延长到掩膜或图像边缘</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Rebuild junctions</source>
        <translation>重建分叉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>lead vessel branches into their trunk as their walls run, not as the skeleton</source>
        <translation>让血管分支顺着管壁而不是骨架汇入主干</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Half size thinning</source>
        <translation>半尺寸细化</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>thin the vessel on every second pixel: faster, same topology</source>
        <translation>隔一个像素细化血管：更快，拓扑相同</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gap repair</source>
        <translation>断点修复</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gap repair of the robot's skeleton.</source>
        <translation>机器人骨架的断点修复。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Rule</source>
        <translation>规则</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>every_pair = the paper's Algorithm 1, literally</source>
        <translation>every_pair = 论文的算法 1，逐字实现</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gap threshold</source>
        <translation>断点阈值</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>ends nearer to each other than this may be joined</source>
        <translation>距离小于此的端点可以连接</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max turn</source>
        <translation>最大转角</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>largest turn that joining two ends may make; not used by every_pair</source>
        <translation>连接两个端点允许的最大转角；every_pair 不使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Robot path</source>
        <translation>机器人路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Choice of the robot's path among candidates.</source>
        <translation>在候选中选择机器人路径。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Weight length</source>
        <translation>长度权重</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of a candidate's length; negative prefers the shorter</source>
        <translation>候选长度的权重；负值偏好较短的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Weight smoothness</source>
        <translation>平滑权重</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of how little a candidate turns at its points</source>
        <translation>候选在各点转弯越少越好的权重</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Weight consistency</source>
        <translation>一致性权重</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of how well its steps go from start to end</source>
        <translation>各步与首尾方向一致程度的权重</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Step</source>
        <translation>步长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>distance over which directions are taken</source>
        <translation>计算方向所用的距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Cosine</source>
        <translation>余弦</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>absolute = the paper's |cos|, blind to hairpins</source>
        <translation>absolute = 论文的 |cos|，分辨不出回头弯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min length</source>
        <translation>最小长度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>shorter candidates are no robot</source>
        <translation>更短的候选不是机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Border</source>
        <translation>边界</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>an end this near to the image border counts as the entry</source>
        <translation>离图像边缘这么近的端点视为入口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>an end this near to the insertion port counts as the entry</source>
        <translation>离插入口这么近的端点视为入口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Port x share</source>
        <translation>插入口 x 比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>insertion port: share of the picture's width; a rig's own goes before it</source>
        <translation>插入口：占图像宽度的比例；装置自己的优先</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Port y share</source>
        <translation>插入口 y 比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the same of its height; one is missing: not known</source>
        <translation>占图像高度的比例；缺其一：未知</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Junction turn</source>
        <translation>分叉转弯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a right-angled turn at a junction costs a branch this length</source>
        <translation>在分叉处直角转弯使分支损失这么多长度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Outside cost</source>
        <translation>血管外代价</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>px a branch loses per px outside the vessel at its end</source>
        <translation>分支末端在血管外每 px 损失的 px</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Outlier share</source>
        <translation>离群比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pieces shorter than this share of the longest are outliers; 0 = only the score decides</source>
        <translation>短于最长者此比例的碎片为离群；0 = 只由评分决定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Smoothing</source>
        <translation>平滑</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>smoothing and sub-pixel centring of the path; 0 = raw pixels</source>
        <translation>路径的平滑与亚像素居中；0 = 原始像素</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max candidates</source>
        <translation>最多候选</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no more paths than these are compared in one frame</source>
        <translation>一帧中最多比较这么多条路径</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Line fits</source>
        <translation>直线拟合</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Line fits.</source>
        <translation>直线拟合。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Robot length</source>
        <translation>机器人长度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>end of the robot's path that its line is fitted to</source>
        <translation>拟合直线所用的机器人路径末段</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Vessel half length</source>
        <translation>血管半长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>so far to both sides of the head goes the piece of centerline that is fitted</source>
        <translation>头端两侧各取这么长的中心线来拟合</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Vessel rule</source>
        <translation>血管规则</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>window = all skeleton pixels near the head, the paper's way</source>
        <translation>window = 头端附近的所有骨架像素，即论文的做法</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Line fit</source>
        <translation>拟合方式</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>least_squares = the paper's linear fit: y on x (in a steep piece x on y)</source>
        <translation>least_squares = 论文的线性拟合：y 对 x（陡处为 x 对 y）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pose state thresholds; hysteresis acts in a stream only.</source>
        <translation>位姿状态阈值；滞回只在连续图像中起作用。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Allowed distance</source>
        <translation>允许的距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>distance of head and tail that is still on the centerline</source>
        <translation>头端和尾端仍算在中心线上的距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Allowed angle</source>
        <translation>允许的夹角</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>angle that is still along the centerline</source>
        <translation>仍算与中心线同向的角度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Hysteresis, distance</source>
        <translation>滞回，距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>state A is left only this far beyond its limit</source>
        <translation>超出其限值这么多之后才离开状态 A</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Hysteresis, angle</source>
        <translation>滞回，角度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Dwell</source>
        <translation>停留时间</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a new state must have been seen for so long to be shown</source>
        <translation>新状态须已出现这么久才会显示</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Quality gate</source>
        <translation>质量把关</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>When perception refuses to answer, and with which reason.</source>
        <translation>感知何时拒绝给出结果，以及以什么原因。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Enabled</source>
        <translation>启用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>false = answer wherever a pose can be computed at all, as the paper does</source>
        <translation>false = 只要能算出位姿就给出，与论文相同</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Black level</source>
        <translation>全黑亮度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>99th percentile of brightness below this: black</source>
        <translation>亮度的第 99 百分位低于此：全黑</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>White level</source>
        <translation>过曝亮度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>1st percentile of brightness above this: overexposed</source>
        <translation>亮度的第 1 百分位高于此：过曝</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min sharpness</source>
        <translation>最低清晰度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>steepest step per px against the contrast; 0 = not checked</source>
        <translation>每 px 最陡变化与对比度之比；0 = 不检查</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min robot length</source>
        <translation>最短机器人</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a shorter robot has no direction</source>
        <translation>更短的机器人没有方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min inside vessel</source>
        <translation>最低血管内比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of the robot's last 40 px that must lie in the lumen</source>
        <translation>机器人末段 40 px 必须在管腔内的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max wall blur</source>
        <translation>管壁模糊上限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>width of the model's doubt at the vessel's walls beside the head; at a lumen that it knows some 1 px</source>
        <translation>模型对头部旁血管壁位置存疑的宽度；对其熟悉的管腔约为 1 px</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max bridged share</source>
        <translation>最大桥接比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>repaired length over path length</source>
        <translation>修复长度与路径长度之比</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max ambiguity</source>
        <translation>最大歧义</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>how near the second best path may come to the best one</source>
        <translation>次优路径可以接近最优路径的程度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min confidence</source>
        <translation>最低置信度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>an answer with less confidence is not given</source>
        <translation>置信度低于此值的结果不给出</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Confident from</source>
        <translation>确信起点</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>an answer with less confidence is shown as unsure</source>
        <translation>置信度低于此值的结果显示为不确定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max novelty</source>
        <translation>新异度上限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>distance from the pictures that the model knows; 1: hardly any of them is farther</source>
        <translation>与模型已知图像的距离；1：几乎没有已知图像更远</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Several robots share</source>
        <translation>多机器人比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a second robot this large against the first one</source>
        <translation>第二个机器人与第一个相比的大小</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tracking</source>
        <translation>跟踪</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Use of the last frames in a stream.</source>
        <translation>在连续图像中利用前几帧。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>false = every frame by itself</source>
        <translation>false = 每帧独立处理</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max head speed</source>
        <translation>头端最大速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a head that jumps faster is not believed</source>
        <translation>跳变更快的头端不予采信</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Memory</source>
        <translation>记忆</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>older frames tell at most which end is the head</source>
        <translation>更早的帧至多说明哪一端是头部</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Window</source>
        <translation>窗口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>side of what is looked at anew between two whole looks; 0 = always all</source>
        <translation>两次整图查看之间重新查看区域的边长；0 = 总是整图</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Refresh</source>
        <translation>刷新</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>longest time between two whole looks, the last four of which tell the vessel</source>
        <translation>两次完整查看之间的最长时间；血管由最近四次完整查看得出</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Route gap</source>
        <translation>路线缺口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>gap in the vessel over which a known route still holds</source>
        <translation>已知路线在血管多长的缺口上仍然有效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Route reach</source>
        <translation>路线偏距</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the head is on a known route if no farther beside it</source>
        <translation>头端离已知路线不超过此距离即视为在路线上</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Lookalike</source>
        <translation>相似物</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a piece that stays while the robot's end moves so far is no robot; 0 = it may be</source>
        <translation>机器人末端移动这么远而自身不动的片段不是机器人；0 = 也可能是</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Speeds behind the paper's words, and how theta becomes a degree of steering.</source>
        <translation>论文用语对应的速度，以及 θ 如何变为转向度数。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in state C, moving away from the centerline</source>
        <translation>状态 C，正偏离中心线时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in state B, coming back to it</source>
        <translation>状态 B，正回到中心线时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in state D, when it has been crossed</source>
        <translation>状态 D，已越过中心线时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in state A, on it and along it</source>
        <translation>状态 A，在中心线上且同向时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Steer gain</source>
        <translation>转向增益</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>degrees of steering per degree of theta in state D</source>
        <translation>状态 D 中每度 θ 的转向度数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Steer gain away</source>
        <translation>偏离时转向增益</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the same in state C, where the paper steers hardest</source>
        <translation>状态 C 中的同一增益，论文在此转向最大</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max steer</source>
        <translation>最大转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>more steering is never advised</source>
        <translation>不会建议更大的转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Policy</source>
        <translation>策略</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Who advises, and drives when handed over to.</source>
        <translation>由谁给建议，以及移交后由谁驾驶。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>table = the paper's; push and random are baselines of trial</source>
        <translation>table = 论文的表；push 和 random 是试验的基线</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pursuit</source>
        <translation>前视跟踪</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Look-ahead along the route.</source>
        <translation>沿路线前视。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pixels per mm</source>
        <translation>每 mm 像素数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the view, roughly; a calibrated rig has its own scale</source>
        <translation>视野的大致比例；已标定的装置有自己的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Look ahead</source>
        <translation>前视距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>distance of the look-ahead point from a resting head</source>
        <translation>头端静止时前视点的距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>so much way at the present speed is added to it</source>
        <translation>再加上以当前速度走这么久的路程</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Rounding</source>
        <translation>圆角</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>added to the rounding of a branch's corner after each miss</source>
        <translation>每次错过后加到分支拐角圆角上的量</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Heading</source>
        <translation>朝向段</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>end of the robot whose direction is the head's</source>
        <translation>以机器人的这段末端作为头端方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>degrees of steering per degree of error</source>
        <translation>每度误差的转向度数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>time constant of the steering's low-pass</source>
        <translation>转向低通滤波的时间常数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Preview</source>
        <translation>预览</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>bends and bifurcations so far ahead slow the robot down</source>
        <translation>前方这么远以内的弯和分叉使机器人减速</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Brake</source>
        <translation>减速距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>way left at which it begins to slow down for the target</source>
        <translation>距目标剩余多少路程时开始减速</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gentle turn</source>
        <translation>缓弯</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>turn within the preview that still allows full speed</source>
        <translation>预览范围内仍允许全速的转角</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Slow steer</source>
        <translation>慢速转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>missing turn above which the robot goes slow</source>
        <translation>尚缺转角超过此值时机器人慢行</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Stuck</source>
        <translation>卡滞</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no progress for so long: back off</source>
        <translation>这么久没有进展：后退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Stuck share</source>
        <translation>卡滞比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>progress below this share of what was advised is none</source>
        <translation>进展低于建议的此比例视为没有进展</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Back off</source>
        <translation>后退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>way back when stuck, at least</source>
        <translation>卡滞时的后退距离，至少</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Behind</source>
        <translation>在后方</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the way must have lain behind the head for so long to back off</source>
        <translation>去路须在头端后方这么久才后退</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Retry</source>
        <translation>重试</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>way back from where a missed branch lies beside the head</source>
        <translation>错过的分支在头端旁时，从此处后退的距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Arrive</source>
        <translation>到达</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>way left at which the target counts as reached</source>
        <translation>剩余路程小于此视为到达目标</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Most misses</source>
        <translation>最多错过次数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>after missing a branch so often it gives up and stops</source>
        <translation>错过同一分支达此次数后放弃并停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Most tries</source>
        <translation>最多尝试次数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>backed off so often without coming farther: it gives up and stops</source>
        <translation>后退这么多次仍未前进：放弃并停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Advice to command</source>
        <translation>从建议到指令</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>From advice to the tendons' bend and the feed.</source>
        <translation>从建议到驱动丝弯曲和推送。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Turn</source>
        <translation>转角</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>by how much the head turns at a bend of 1</source>
        <translation>弯曲为 1 时头端转过的角度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Proportional</source>
        <translation>比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of the advised turn that is made at once</source>
        <translation>建议的转角中立即执行的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Integral</source>
        <translation>积分</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>time in which the advised turn is made, if advice stays the same</source>
        <translation>建议不变时，执行完建议转角所需的时间</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max bend rate per s</source>
        <translation>最大弯曲速率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of the tendons' full pull per second, at most</source>
        <translation>每秒至多占驱动丝最大牵拉的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max acceleration</source>
        <translation>最大加速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the feed</source>
        <translation>推送的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max gap</source>
        <translation>最大间隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a longer pause between two commands counts as so much</source>
        <translation>两条指令间更长的间隔按此计算</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Driving by hand</source>
        <translation>手动驾驶</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Driving by hand: speeds at full deflection of a key or a stick.</source>
        <translation>手动驾驶：按键或摇杆到底时的速度。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bend rate per s</source>
        <translation>弯曲速率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of the tendons' full pull per second</source>
        <translation>每秒占驱动丝最大牵拉的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Advance</source>
        <translation>前进</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the robot module</source>
        <translation>机器人模块的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Delivery</source>
        <translation>输送</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the catheter</source>
        <translation>鞘管的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Rotation deg</source>
        <translation>旋转角度(度)</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the shaft, where it can be turned</source>
        <translation>轴的旋转角(如果可以转动)</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>The bus and the robot's joints.</source>
        <translation>总线和机器人的关节。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Driver</source>
        <translation>驱动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what is on the port</source>
        <translation>端口上接的设备</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>serial device; empty: the twin's own pseudo-terminal</source>
        <translation>串口设备；留空：孪生自带的伪终端</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Baud</source>
        <translation>波特率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>speed of the bus</source>
        <translation>总线的速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model number of the servos (1020: XM430-W350); a joint may have another</source>
        <translation>舵机型号（1020：XM430-W350）；各关节可另设</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pull of every tendon at zero bend</source>
        <translation>弯曲为零时每根驱动丝的牵拉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>speed at which wires are pulled to it after the servos were switched on</source>
        <translation>舵机开启后把拉线拉到预紧的速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max pull</source>
        <translation>最大牵拉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pull at a bend or pitch of 1</source>
        <translation>弯曲或俯仰为 1 时的牵拉</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bus rate</source>
        <translation>总线频率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>how often the servos are asked and told</source>
        <translation>询问和指令舵机的频率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Heartbeat timeout</source>
        <translation>心跳超时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>silence of the application after which the bus holds</source>
        <translation>程序静默这么久，总线即保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Watchdog</source>
        <translation>看门狗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servos' own bus watchdog</source>
        <translation>舵机自己的总线看门狗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max temperature</source>
        <translation>最高温度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a hotter servo ends the driving; 5 °C below its own limit at most</source>
        <translation>舵机更热则结束驱动；最多比其自身限值低 5 °C</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min voltage</source>
        <translation>最低电压</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a lower supply ends the driving; empty: 7/8 of what each servo's model recommends</source>
        <translation>电源更低则结束驱动；空：各舵机型号推荐值的 7/8</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tracking error</source>
        <translation>跟踪误差</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>distance of goal and measured position that counts as jam</source>
        <translation>目标与测得位置相差这么多视为卡住</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Unattended</source>
        <translation>无人值守</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos that hold without the program are watched for so long, then relaxed and switched off; 0: they hold on</source>
        <translation>没有程序而仍保持的舵机被监视的时间，之后放松并断开；0：一直保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>At close</source>
        <translation>关闭时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>servos that hold when the program is closed; without a window or terminal to ask in they hold</source>
        <translation>程序关闭时仍保持的舵机；没有窗口或终端可询问时保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Torque off on stop</source>
        <translation>停止时关闭力矩</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>also switch the torque off at STOP; it releases the tension of the wires</source>
        <translation>停止时也关闭力矩；驱动丝的张力随之释放</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint right</source>
        <translation>关节：右</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>One servo and the joint that it drives.</source>
        <translation>一个舵机及其驱动的关节。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>on the bus</source>
        <translation>在总线上</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>model number of its servo; empty: servos.model</source>
        <translation>该舵机的型号；空：servos.model</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Sign</source>
        <translation>方向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>direction of the servo that increases the joint's millimetres</source>
        <translation>使关节毫米数增大的舵机转向</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max force</source>
        <translation>最大力</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the servo itself gives no more, its gear's friction included; tendons 20 (a wire of 0.15 mm bears 25 to 35), feed and delivery 30; raise it where a joint does not follow though nothing is jammed</source>
        <translation>舵机本身最多给出此力，含齿轮摩擦；拉线 20（0.15 mm 的线可承受 25 到 35），进给和输送 30；关节不跟随而又没有卡住时，调高它</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>mm per turn</source>
        <translation>每圈 mm</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>way of the joint at one turn of the servo's horn</source>
        <translation>舵盘转一圈时关节的行程</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Low</source>
        <translation>下限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>end of the envelope: nothing is sent beyond it</source>
        <translation>行程范围的一端：绝不发送超出它的目标</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>High</source>
        <translation>上限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>its other end</source>
        <translation>其另一端</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Warn margin</source>
        <translation>警告边距</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>so near to the envelope's end the joint is slowed down</source>
        <translation>离行程末端这么近时关节减速</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max speed</source>
        <translation>最大速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>the joint is never sent faster</source>
        <translation>关节绝不会被更快地驱动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>nor sped up or slowed down harder</source>
        <translation>也不会更猛地加速或减速</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max step</source>
        <translation>最大步长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>farthest goal from the measured position</source>
        <translation>目标与测得位置的最大距离</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint left</source>
        <translation>关节：左</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint up</source>
        <translation>关节：上</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint down</source>
        <translation>关节：下</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint advance</source>
        <translation>关节：前进</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint delivery 1</source>
        <translation>关节：鞘管 1</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Joint delivery 2</source>
        <translation>关节：鞘管 2</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Safety</source>
        <translation>安全</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>When the program holds, disarms or stops. Ages count from the capture of the frame, not from its arrival.</source>
        <translation>程序何时保持、解除待命或停止。时间从图像采集算起，而非到达。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Command max age</source>
        <translation>指令最长时效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>an older command is dropped</source>
        <translation>更旧的指令被丢弃</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Measurement max age</source>
        <translation>测量最长时效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>older positions of the servos are not believed</source>
        <translation>更旧的舵机位置不予采信</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Margin speed share</source>
        <translation>边距速度比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of max_speed_mm_s, inside the envelope's warn margin</source>
        <translation>占 max_speed_mm_s 的比例，在行程警告边距内</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pose hold</source>
        <translation>位姿保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no pose for so long holds</source>
        <translation>这么久没有位姿则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pose disarm</source>
        <translation>位姿解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>and for so long disarms</source>
        <translation>这么久则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame hold</source>
        <translation>图像保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no frame for so long holds</source>
        <translation>这么久没有图像则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame disarm</source>
        <translation>图像解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bus hold</source>
        <translation>总线保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>silence of the servo bus that holds</source>
        <translation>舵机总线静默这么久则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bus disarm</source>
        <translation>总线解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>and that disarms</source>
        <translation>这么久则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Clock gap</source>
        <translation>时钟间隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a longer pause between two ticks means suspend: disarm</source>
        <translation>两次循环间更长的停顿意味着休眠：解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Healthy</source>
        <translation>正常时间</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>camera and perception must have been well for so long before arming</source>
        <translation>进入待命前，相机和感知须正常这么久</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Hold clear</source>
        <translation>保持解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>after that a hold no longer clears itself</source>
        <translation>此后保持不再自动解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Hold dwell</source>
        <translation>保持停留</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>all must be well for so long before a hold clears itself</source>
        <translation>全部正常这么久，保持才自动解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Hold repeat</source>
        <translation>保持重复</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a hold so soon after the last one is the same hold</source>
        <translation>距上次保持这么短的算同一次保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Deadman timeout</source>
        <translation>使能键超时</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>silence that counts as released; with a tick &lt; 100 ms</source>
        <translation>静默这么久视为松开；循环小于 100 ms</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Operator quiet</source>
        <translation>操作者静默</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no hand-over so shortly after the operator's last input</source>
        <translation>操作者最后输入后这么短时间内不能移交</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Equal frames</source>
        <translation>相同帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>identical pictures in a row that mean a frozen camera</source>
        <translation>连续这么多张相同图像意味着相机冻结</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Dark frames</source>
        <translation>全黑帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>black or overexposed pictures in a row that hold</source>
        <translation>连续这么多张全黑或过曝图像则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Head lost frames</source>
        <translation>头端丢失帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>frames in a row without a head that hold</source>
        <translation>连续这么多帧没有头端则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Head lost disarm</source>
        <translation>头端丢失解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no head for so long disarms</source>
        <translation>这么久没有头端则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Broken results</source>
        <translation>错误结果</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>non-finite results or rejected commands in a row that disarm</source>
        <translation>连续这么多个非有限结果或被拒指令则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame loss window</source>
        <translation>丢帧统计窗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>over which lost frames are counted</source>
        <translation>统计丢帧的时间窗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame loss min frames</source>
        <translation>丢帧最少帧数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>fewer frames in the window say nothing about loss</source>
        <translation>窗内帧数更少时不能判断丢帧</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame loss warn share</source>
        <translation>丢帧警告比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of frames lost that warns</source>
        <translation>丢帧达此比例则警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame loss hold share</source>
        <translation>丢帧保持比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of frames lost that holds</source>
        <translation>丢帧达此比例则保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Frame loss disarm</source>
        <translation>丢帧解除</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>loss above the hold share for so long disarms</source>
        <translation>丢帧超过保持比例这么久则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Min confidence to drive</source>
        <translation>驾驶所需最低置信度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>on less confidence the program rests, then holds</source>
        <translation>置信度低于此值时程序先静止，随后保持</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Confidence hysteresis</source>
        <translation>置信度滞回</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>how much more confidence is needed to go on</source>
        <translation>恢复继续还需高出多少置信度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max drift</source>
        <translation>最大漂移</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>movement of the landmarks that means a moved camera</source>
        <translation>标志点移动这么多意味着相机被移动</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Missed answers</source>
        <translation>缺失应答</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>in a row, of one servo</source>
        <translation>单个舵机连续的</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bus errors</source>
        <translation>总线错误</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>more bad packets in bus_errors_window_s disarm</source>
        <translation>bus_errors_window_s 内坏包更多则解除待命</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Bus errors window</source>
        <translation>总线错误时间窗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>over which bad packets are counted</source>
        <translation>统计坏包的时间窗</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Tracking time</source>
        <translation>跟踪时间</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>tracking_error_mm exceeded for so long means a jam</source>
        <translation>超过 tracking_error_mm 这么久意味着卡住</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Temperature warn margin</source>
        <translation>温度警告边距</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>so near to servos.max_temperature_c warns</source>
        <translation>离 servos.max_temperature_c 这么近则警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Voltage warn margin</source>
        <translation>电压警告边距</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>so near to servos.min_voltage_v warns</source>
        <translation>离 servos.min_voltage_v 这么近则警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Foot pedal</source>
        <translation>脚踏板</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Foot pedal: deadman and STOP over a serial line. Wiring: docs/bench.md.</source>
        <translation>脚踏板：通过串行线的使能和停止。接线：docs/bench.md。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>stable path in /dev/serial/by-id; empty: no pedal</source>
        <translation>/dev/serial/by-id 中的固定路径；留空：没有脚踏板</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>speed of the line</source>
        <translation>线路速度</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Silence</source>
        <translation>静默</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>no report for so long: the deadman counts as released</source>
        <translation>这么久没有报告：使能键视为松开</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Press reports</source>
        <translation>按下报告数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>whole reports in a row that make a press; one makes a release, or a STOP</source>
        <translation>连续这么多个完整报告才算按下；一个即算松开或停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Resume</source>
        <translation>恢复</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>after a longer interruption the foot must be lifted before a press counts again</source>
        <translation>中断更久之后，须先抬脚，再次踩下才有效</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pause between two attempts to open the port</source>
        <translation>两次尝试打开端口之间的间隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Gamepad</source>
        <translation>手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Sticks and buttons that drive by hand. Which does what: docs/bench.md.</source>
        <translation>手动驾驶的摇杆和按钮。各自作用：docs/bench.md。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>false = gamepads are left alone</source>
        <translation>false = 不使用手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>path in /dev/input; empty: the first gamepad that is plugged in</source>
        <translation>/dev/input 中的路径；留空：第一个插入的手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Dead zone</source>
        <translation>死区</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>share of a stick's or trigger's way that counts as rest</source>
        <translation>摇杆或扳机行程中视为静止的比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Expo</source>
        <translation>指数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>0 = linear, 1 = cubic: finer near the middle</source>
        <translation>0 = 线性，1 = 三次：中间更细腻</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>right shoulder button as deadman; for wired gamepads only</source>
        <translation>右肩键作为使能键；仅限有线手柄</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>How the windows look, where they keep pictures, and what they ask before a hand-over.</source>
        <translation>窗口的外观、图片的保存位置，以及移交前的检查。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Theme</source>
        <translation>主题</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of all windows; system = as the desktop has it</source>
        <translation>所有窗口的；system = 跟随桌面</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Language</source>
        <translation>语言</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of all windows; auto = the system's, en = English, zh = Chinese (simplified)</source>
        <translation>所有窗口的语言；auto = 随系统，en = 英文，zh = 中文（简体）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Pictures folder</source>
        <translation>图片文件夹</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>where snapshots go; empty: LumenPilot in Pictures</source>
        <translation>截图保存的位置；留空：“图片”中的 LumenPilot</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Needs rehearsal</source>
        <translation>需要预演</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>hand-over needs a rehearsal of this target (menu Robot)</source>
        <translation>移交需要先预演此目标点（“机器人”菜单）</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>How sessions are recorded.</source>
        <translation>如何录制会话。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Folder</source>
        <translation>文件夹</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>where sessions go; empty: LumenPilot in Videos</source>
        <translation>会话保存的位置；留空：“视频”中的 LumenPilot</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Codec</source>
        <translation>编码</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>lossless keeps every pixel, at a hundred times the size</source>
        <translation>lossless 保留每个像素，体积为百倍</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Quality CRF</source>
        <translation>质量 CRF</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the lossy video; smaller is better and larger</source>
        <translation>有损视频的；越小越好、越大</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max bit rate</source>
        <translation>最大码率</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>upper end of the lossy video at 640x480; grows with the picture</source>
        <translation>640x480 有损视频的上限；随图像增大</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>also keep the outlines of both masks and the vessel's centerlines, for the player</source>
        <translation>也保存两个掩膜的轮廓和血管中心线，供回放器使用</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Split after</source>
        <translation>分割时长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>a new video file after so long</source>
        <translation>这么久之后另起视频文件</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Sync every</source>
        <translation>同步间隔</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>how often the files are forced to the disk; 0 = left to the system</source>
        <translation>强制写入磁盘的间隔；0 = 由系统决定</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Max queue</source>
        <translation>最大队列</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>frames waiting for the recorder; more are dropped and counted</source>
        <translation>等待录制的帧数；更多的被丢弃并计数</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Ring length</source>
        <translation>环形缓存时长</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>what 'save the last seconds' keeps in memory; 0 = off</source>
        <translation>“保存最近几秒”在内存中保留的内容；0 = 关闭</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Ring size</source>
        <translation>环形缓存大小</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>and its upper end</source>
        <translation>以及其上限</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Warn free</source>
        <translation>剩余警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>less free disk warns</source>
        <translation>磁盘剩余更少则警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Warn free share</source>
        <translation>剩余警告比例</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>less free disk, as a share of it, warns</source>
        <translation>磁盘剩余比例更低则警告</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Stop free</source>
        <translation>剩余停止</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>less free disk ends the recording while it can still be closed</source>
        <translation>磁盘剩余更少则趁还能收尾时结束录制</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Live output</source>
        <translation>实时输出</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>What goes to other programs while the rig runs: docs/operating.md.</source>
        <translation>装置运行时传给其他程序的内容：docs/operating.md。</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>Foxglove</source>
        <translation>Foxglove</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pictures, overlays, pose and joints as a WebSocket for Foxglove, on this computer</source>
        <translation>图像、叠加层、位姿和关节，作为供 Foxglove 使用的 WebSocket，仅限本机</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>of the WebSocket</source>
        <translation>WebSocket 的端口</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>LSL</source>
        <translation>LSL</translation>
    </message>
    <message>
        <location filename="../../app/ui/i18n.py"/>
        <source>pose and markers for the lab streaming layer, in the local network</source>
        <translation>供 lab streaming layer 使用的位姿和标记，在局域网中</translation>
    </message>
</context>
</TS>
